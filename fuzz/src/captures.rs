//! Checks for the readers of captures.

use std::io;

use allocation_counter::measure;
use arbitrary::Arbitrary;
use glam::DVec3;
use plenoctree_fit::splat::{Axis, SplatSettings, Splats, Subject, SubjectSettings, VoxelSettings, voxelize};

use crate::{fields::check_seen, message::check_message};

/// Maximum memory that a small file may take.
const MOST_MEMORY: u64 = 1 << 30;
/// The maximum number of Gaussians of captures that are converted to fields.
const MOST_CONVERTED: usize = 16;

/// Checks that a file gives valid Gaussians or a valid error message, without much memory.
pub fn check_capture(bytes: &[u8]) {
    let mut result = None;
    let allocations = measure(|| {
        // The file next to it is the same one again.
        let mut beside = |_: &str| -> io::Result<Vec<u8>> { Ok(bytes.to_vec()) };
        result = Some(Splats::from_bytes(bytes, "capture", &SplatSettings::default(), &mut beside));
    });
    assert!(allocations.bytes_max < MOST_MEMORY, "{} bytes", allocations.bytes_max);
    match result {
        Some(Ok(splats)) => {
            assert!(!splats.is_empty() && splats.degree() <= 3);
            for (index, gaussian) in splats.gaussians().iter().enumerate() {
                assert!(gaussian.position.is_finite() && gaussian.scale.is_finite(), "{gaussian:?}");
                assert!(gaussian.scale.min_element() >= 0.0 && gaussian.rotation.is_normalized(), "{gaussian:?}");
                assert!((0.0..=1.0).contains(&gaussian.opacity), "{gaussian:?}");
                assert!(splats.color(index, DVec3::X).is_finite(), "{gaussian:?}");
            }
            if splats.len() <= MOST_CONVERTED {
                check_converted(splats);
            }
        }
        Some(Err(error)) => check_message(&error, 0),
        None => {}
    }
}

/// Checks that a capture gives a valid field or a valid error message.
fn check_converted(splats: Splats) {
    let keep_largest = splats.len().is_multiple_of(2);
    let settings = SubjectSettings { keep_largest, up: Some(Axis::NegativeY), ..SubjectSettings::default() };
    let convert = |Subject { splats, low, high, .. }| {
        voxelize(&splats, &VoxelSettings { depth: 6, bounds: Some((low, high)), ..Default::default() })
    };
    match splats.subject(&settings).and_then(convert) {
        Ok(field) => check_seen(&field),
        Err(error) => check_message(&error, 0),
    }
}

/// The content of a capture.
#[derive(Arbitrary, Debug)]
pub enum CaptureFile<'a> {
    /// Any bytes.
    Bytes(&'a [u8]),
    /// A PLY file with these properties, and data.
    Ply { big_endian: bool, count: u16, properties: Vec<u8>, data: &'a [u8] },
    /// A compressed PLY file with these numbers of rows, and data.
    PackedPly { chunks: u8, count: u16, harmonics: u8, data: &'a [u8] },
    /// The content of an SPZ file before it is compressed.
    Spz { version: u8, count: u16, degree: u8, planes: &'a [u8] },
    /// The chunks of a `.glb` file.
    Gltf { json: &'a str, buffer: &'a [u8] },
    /// `meta.json` of a SOG folder, whose images are the file itself.
    Json(&'a str),
}

const PLY_PROPERTIES: [&str; 15] = [
    "float x",
    "float y",
    "float z",
    "float scale_0",
    "float scale_1",
    "float scale_2",
    "float rot_0",
    "float rot_1",
    "double rot_2",
    "short rot_3",
    "float opacity",
    "float f_dc_0",
    "uchar f_dc_1",
    "float f_dc_2",
    "list uchar int other",
];

impl CaptureFile<'_> {
    pub fn build(&self) -> Vec<u8> {
        match self {
            Self::Bytes(bytes) => bytes.to_vec(),
            Self::Json(json) => json.as_bytes().to_vec(),
            Self::Ply { big_endian, count, properties, data } => {
                let format = if *big_endian { "binary_big_endian" } else { "binary_little_endian" };
                // All of them, in an order that the input changes.
                let mut names = PLY_PROPERTIES.to_vec();
                for (index, swap) in properties.iter().enumerate().take(names.len()) {
                    let other = usize::from(*swap) % names.len();
                    names.swap(index, other);
                }
                let names: String = names.iter().map(|name| format!("property {name}\n")).collect();
                let header = format!("ply\nformat {format} 1.0\nelement vertex {count}\n{names}end_header\n");
                [header.as_bytes(), data].concat()
            }
            Self::PackedPly { chunks, count, harmonics, data } => {
                let names = ["x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"];
                let end = |end: &str| -> String {
                    names.iter().map(|name| format!("property float {end}_{name}\n")).collect()
                };
                let ends = end("min") + &end("max");
                let packed = ["position", "rotation", "scale", "color"];
                let packed: String = packed.iter().map(|name| format!("property uint packed_{name}\n")).collect();
                let rest: String = (0..*harmonics).map(|index| format!("property uchar f_rest_{index}\n")).collect();
                let header = format!(
                    "ply\nformat binary_little_endian 1.0\nelement chunk {chunks}\n{ends}element vertex \
                     {count}\n{packed}element sh {count}\n{rest}end_header\n"
                );
                [header.as_bytes(), data].concat()
            }
            Self::Spz { version, count, degree, planes } => {
                let mut content = b"NGSP".to_vec();
                content.extend(u32::from(*version).to_le_bytes());
                content.extend(u32::from(*count).to_le_bytes());
                content.extend([*degree, 12, 2, 0]);
                content.extend(*planes);
                let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
                let written = std::io::Write::write_all(&mut encoder, &content).and_then(|()| encoder.finish());
                written.expect("memory takes all bytes")
            }
            Self::Gltf { json, buffer } => {
                let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
                for (kind, content) in [(b"JSON", json.as_bytes()), (b"BIN\0", buffer)] {
                    bytes.extend((content.len() as u32).to_le_bytes());
                    bytes.extend(kind);
                    bytes.extend(content);
                }
                bytes
            }
        }
    }
}
