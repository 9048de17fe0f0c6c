//! SPZ files, versions 2 to 4, as <https://github.com/nianticlabs/spz> defines them.

use std::io::Read;

use flate2::read::GzDecoder;
use glam::{DAffine3, DMat3, DVec3, Quat, Vec3};
use ruzstd::decoding::StreamingDecoder;

use super::{settings::SpzAxes, shared::check_count};
use crate::{
    file::{Bytes, Fault},
    splat::{
        harmonics::functions,
        splats::{Gaussian, MOST_DEGREE, Splats},
    },
};

const MAGIC: [u8; 4] = *b"NGSP";
/// The highest degree of harmonics that files have.
const MOST_STORED_DEGREE: u8 = 4;
/// Factor by which colors are multiplied before they are stored.
const COLOR_SCALE: f32 = 0.15;
/// Flag: the capture was trained with antialiasing.
const ANTIALIASED: u8 = 1;
/// Flag: extensions follow.
const EXTENSIONS: u8 = 2;
/// The extension that records the axes.
const COORDINATE_SYSTEM: u32 = 0xadbe_0003;
/// The number of right, up and back in it.
const RIGHT_UP_BACK: u32 = 4;
/// Its number of right, down and front.
const RIGHT_DOWN_FRONT: u32 = 6;
/// Maximum number of bytes of extensions that are read.
const MAX_EXTENSIONS: u64 = 1 << 16;

struct Header {
    version: u32,
    count: usize,
    degree: u32,
    stored_degree: u32,
    fractional_bits: u8,
    flags: u8,
}

/// The bytes of every property: positions, opacities, colors, scales, rotations and harmonics.
type Planes = [Vec<u8>; 6];

/// Reads a file. Its axes become those of `.ply` files.
pub fn read(bytes: &[u8], axes: SpzAxes) -> Result<Splats, Fault> {
    let (splats, recorded) = read_as_stored(bytes)?;
    let default = match axes {
        SpzAxes::Unknown | SpzAxes::RightUpBack => RIGHT_UP_BACK,
        SpzAxes::RightDownFront => RIGHT_DOWN_FRONT,
    };
    let turn = to_right_down_front(recorded.unwrap_or(default))?;
    let mut splats = if turn == DMat3::IDENTITY { splats } else { splats.transformed(DAffine3::from_mat3(turn)) };
    splats.assumes_axes = recorded.is_none() && axes == SpzAxes::Unknown;
    Ok(splats)
}

/// Reads a file, and the axes that it records.
pub fn read_as_stored(bytes: &[u8]) -> Result<(Splats, Option<u32>), Fault> {
    let (header, planes, extensions) = if bytes.starts_with(&MAGIC) { read_streams(bytes)? } else { read_gzip(bytes)? };
    Ok((unpack(&header, planes), recorded_axes(&extensions)))
}

/// Parses the part of the header that all versions have, without the magic.
fn parse_header(bytes: &mut Bytes, file_size: u64) -> Result<Header, Fault> {
    let magic: [u8; 4] = bytes.array("header")?;
    if magic != MAGIC {
        return Err(Fault::found("header", format!("{magic:02x?}"), "NGSP"));
    }
    let version = bytes.u32("header")?;
    let count = bytes.u32("header")?;
    let [stored, fractional_bits, flags] = bytes.array("header")?;
    if !(2..=4).contains(&version) {
        return Err(Fault::found("version", version.to_string(), "2, 3 or 4"));
    }
    if stored > MOST_STORED_DEGREE {
        return Err(Fault::found("degree of the harmonics", stored.to_string(), "0 to 4"));
    }
    if fractional_bits > 24 {
        return Err(Fault::found("fractional bits", fractional_bits.to_string(), "0 to 24"));
    }
    let count = check_count("header", count.into(), file_size)?;
    let stored_degree = u32::from(stored);
    Ok(Header { version, count, degree: stored_degree.min(MOST_DEGREE), stored_degree, fractional_bits, flags })
}

impl Header {
    /// The sizes of the planes for each Gaussian.
    fn sizes(&self) -> [usize; 6] {
        let rotation = if self.version == 2 { 3 } else { 4 };
        [9, 1, 3, 3, rotation, 3 * (functions(self.stored_degree) - 1)]
    }
}

/// Reads versions 2 and 3: one gzip stream.
fn read_gzip(bytes: &[u8]) -> Result<(Header, Planes, Vec<u8>), Fault> {
    let mut inflated = GzDecoder::new(bytes);
    let mut start = Vec::new();
    let damaged = |error: std::io::Error| Fault::found("gzip stream", error.to_string(), "an SPZ file");
    inflated.by_ref().take(16).read_to_end(&mut start).map_err(damaged)?;
    if start.starts_with(b"ply") {
        return Err(Fault::found("gzip stream", "a compressed .ply file", "an SPZ file: unpack it, as with gunzip"));
    }
    let header = parse_header(&mut Bytes::new(&start), bytes.len() as u64)?;
    if header.version > 3 {
        return Err(Fault::found("version", header.version.to_string(), "2 or 3 in a gzip stream"));
    }
    let names = ["positions", "opacities", "colors", "scales", "rotations", "harmonics"];
    let mut planes = Planes::default();
    for ((plane, size), name) in planes.iter_mut().zip(header.sizes()).zip(names) {
        read_exactly(&mut inflated, header.count * size, plane, name)?;
    }
    // To the end, where the checksum is.
    let mut extensions = Vec::new();
    inflated.take(MAX_EXTENSIONS + 1).read_to_end(&mut extensions).map_err(damaged)?;
    if header.flags & EXTENSIONS == 0 {
        extensions.clear();
    }
    if extensions.len() as u64 > MAX_EXTENSIONS {
        return Err(Fault::found("extensions", "more", format!("at most {MAX_EXTENSIONS} bytes")));
    }
    Ok((header, planes, extensions))
}

/// Reads version 4: a zstd stream for each property.
fn read_streams(bytes: &[u8]) -> Result<(Header, Planes, Vec<u8>), Fault> {
    let mut rest = Bytes::new(bytes);
    let header = parse_header(&mut rest, bytes.len() as u64)?;
    if header.version < 4 {
        return Err(Fault::found(
            "version",
            header.version.to_string(),
            "4, since the file is not compressed as a whole",
        ));
    }
    let [streams] = rest.array("header")?;
    let contents = u64::from(rest.u32("header")?);
    let _reserved: [u8; 12] = rest.array("header")?;
    let before = contents.checked_sub(32).ok_or_else(|| {
        Fault::found("table of contents", format!("an offset of {contents}"), "one behind the header")
    })?;
    let extensions = rest.take(before, "extensions")?;
    let sizes: Vec<usize> = header.sizes().into_iter().filter(|size| *size > 0).collect();
    if usize::from(streams) != sizes.len() && header.count > 0 {
        return Err(Fault::found(
            "table of contents",
            format!("{streams} streams"),
            format!("{} streams", sizes.len()),
        ));
    }
    let mut entries = Vec::new();
    for _ in 0..streams {
        entries.push((rest.u64("table of contents")?, rest.u64("table of contents")?));
    }
    let mut planes = Planes::default();
    for (index, ((packed, unpacked), size)) in entries.into_iter().zip(sizes).enumerate() {
        let what = format!("stream {index}");
        let expected = header.count * size;
        if unpacked != expected as u64 {
            return Err(Fault::found(what, format!("{unpacked} bytes"), format!("{expected} bytes")));
        }
        let mut stream = rest.take(packed, &what)?;
        let mut decoder = StreamingDecoder::new(&mut stream)
            .map_err(|error| Fault::found(what.clone(), error.to_string(), "a zstd stream"))?;
        read_exactly(&mut decoder, expected, &mut planes[index], &what)?;
    }
    let extensions = if header.flags & EXTENSIONS != 0 { extensions.to_vec() } else { Vec::new() };
    Ok((header, planes, extensions))
}

/// Reads `count` bytes. Memory grows with the bytes that exist, not with the expected number.
fn read_exactly(reader: &mut impl Read, count: usize, into: &mut Vec<u8>, what: &str) -> Result<(), Fault> {
    let read = reader.take(count as u64).read_to_end(into);
    match read {
        Ok(_) if into.len() == count => Ok(()),
        Ok(_) => Err(Fault::found(what, format!("{} bytes", into.len()), format!("{count} bytes"))),
        Err(error) => {
            let found = format!("{} bytes and a damaged stream ({error})", into.len());
            Err(Fault::found(what, found, format!("{count} bytes")))
        }
    }
}

fn unpack(header: &Header, planes: Planes) -> Splats {
    let [positions, opacities, colors, scales, rotations, harmonics] = planes;
    let mut splats = Splats::new(header.degree);
    splats.set_antialiased(header.flags & ANTIALIASED != 0);
    splats.reserve(header.count);
    let unit = 0.5f32.powi(header.fractional_bits.into());
    let [.., rotation_size, stored] = header.sizes();
    let mut coefficients = [Vec3::ZERO; 16];
    for index in 0..header.count {
        let position = &positions[9 * index..][..9];
        let coordinate = |axis: usize| {
            let [a, b, c] = [0, 1, 2].map(|byte| position[3 * axis + byte]);
            // The sign is in the highest of 24 bits.
            (i32::from_le_bytes([0, a, b, c]) >> 8) as f32 * unit
        };
        let triple = |plane: &[u8]| [0, 1, 2].map(|byte| f32::from(plane[3 * index + byte]));
        let rotation = &rotations[rotation_size * index..][..rotation_size];
        let gaussian = Gaussian {
            position: Vec3::new(coordinate(0), coordinate(1), coordinate(2)),
            scale: Vec3::from_array(triple(&scales).map(|log| (log / 16.0 - 10.0).exp())),
            rotation: match *rotation {
                [x, y, z] => first_three([x, y, z]),
                [a, b, c, d] => smallest_three(u32::from_le_bytes([a, b, c, d])),
                _ => Quat::IDENTITY,
            },
            opacity: f32::from(opacities[index]) / 255.0,
        };
        coefficients[0] = Vec3::from_array(triple(&colors).map(|byte| (byte / 255.0 - 0.5) / COLOR_SCALE));
        let rest = harmonics[stored * index..][..stored].chunks_exact(3);
        for (coefficient, bytes) in coefficients[1..].iter_mut().zip(rest) {
            *coefficient = Vec3::from_array([0, 1, 2].map(|channel| (f32::from(bytes[channel]) - 128.0) / 128.0));
        }
        splats.push(gaussian, &coefficients[..functions(header.degree)]);
    }
    splats
}

/// Version 2: x, y and z. w follows from them.
fn first_three(bytes: [u8; 3]) -> Quat {
    let vector = Vec3::from_array(bytes.map(|byte| f32::from(byte) / 127.5 - 1.0));
    Quat::from_xyzw(vector.x, vector.y, vector.z, (1.0 - vector.length_squared()).max(0.0).sqrt())
}

/// Later versions: all but the largest, with a sign and nine bits each.
fn smallest_three(mut packed: u32) -> Quat {
    let largest = (packed >> 30) as usize;
    let mut parts = [0.0f32; 4];
    for index in (0..4).rev().filter(|index| *index != largest) {
        let size = std::f32::consts::FRAC_1_SQRT_2 * (packed & 0x1ff) as f32 / 511.0;
        parts[index] = if packed >> 9 & 1 == 1 { -size } else { size };
        packed >>= 10;
    }
    parts[largest] = (1.0 - parts.iter().map(|part| part * part).sum::<f32>()).max(0.0).sqrt();
    Quat::from_array(parts)
}

/// Returns the axes that the extensions record. Unknown extensions are skipped by their length.
fn recorded_axes(extensions: &[u8]) -> Option<u32> {
    let mut rest = Bytes::new(extensions);
    while rest.len() > 0 {
        let (kind, size) = (rest.u32("").ok()?, rest.u32("").ok()?);
        let payload = rest.take(size.into(), "").ok()?;
        if kind == COORDINATE_SYSTEM {
            return Bytes::new(payload).u32("").ok().filter(|axes| *axes > 0);
        }
    }
    None
}

/// Returns the matrix from axes, by their number in the extension, to those of `.ply` files.
fn to_right_down_front(axes: u32) -> Result<DMat3, Fault> {
    let Some(bits) = axes.checked_sub(1).filter(|bits| *bits < 16) else {
        return Err(Fault::found("coordinate system", axes.to_string(), "1 to 16"));
    };
    let is_set = |bit: u32| bits >> bit & 1 == 1;
    let sign = |positive: bool| if positive { 1.0 } else { -1.0 };
    let (right, up, rotated) = (is_set(0), is_set(1), is_set(3));
    // The second half of the list swaps y and z, and lists front before back.
    let front = is_set(2) != rotated;
    let (x, down, front) = (DVec3::X * sign(right), DVec3::Y * sign(!up), DVec3::Z * sign(front));
    Ok(if rotated { DMat3::from_cols(x, front, down) } else { DMat3::from_cols(x, down, front) })
}
