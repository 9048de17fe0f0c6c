//! The compressed `.ply` files of PlayCanvas' tools: chunks of 256 Gaussians, whose numbers are fractions of the chunk's
//! range.

use glam::{Vec3, Vec4};

use super::shared::{constant, without_largest};
use crate::{
    file::{
        Fault,
        ply::{Ply, Rows},
    },
    splat::{
        harmonics::functions,
        splats::{Gaussian, Splats},
    },
};

/// Number of Gaussians of a chunk.
const CHUNK: usize = 256;
/// The range of the higher harmonics.
const HARMONICS: f32 = 8.0;

/// The ranges of a chunk.
struct Chunk {
    position: [Vec3; 2],
    /// Of logarithms.
    scale: [Vec3; 2],
    color: [Vec3; 2],
}

/// Reads a file, of which `vertices` are the packed Gaussians.
pub fn read(ply: &Ply, vertices: &mut Rows) -> Result<Splats, Fault> {
    let chunks = chunks(ply)?;
    let required = |name| vertices.element.required(name, "the properties of a compressed .ply");
    let columns = [
        required("packed_position")?,
        required("packed_rotation")?,
        required("packed_scale")?,
        required("packed_color")?,
    ];
    let mut harmonics = ply.rows("sh")?;
    let stored = harmonics.as_ref().map_or(0, |rows| rows.element.properties.len());
    let Some(degree) = (0..=3u32).find(|&degree| 3 * (functions(degree) - 1) == stored) else {
        return Err(Fault::found("sh", format!("{stored} properties"), "9, 24 or 45"));
    };
    let mut splats = Splats::new(degree);
    if harmonics.as_ref().is_none_or(|rows| rows.certain >= vertices.certain) {
        splats.reserve(vertices.certain);
    }
    let (mut row, mut bytes) = (Vec::new(), Vec::new());
    let mut coefficients = [Vec3::ZERO; 16];
    for index in 0.. {
        if !vertices.read(&mut row)? {
            break;
        }
        let Some(chunk) = chunks.get(index / CHUNK) else {
            let expected = format!("one for every {CHUNK} of {} vertices", vertices.element.count);
            return Err(Fault::found("chunk", format!("{} rows", chunks.len()), expected));
        };
        if let Some(harmonics) = &mut harmonics {
            if !harmonics.read(&mut bytes)? {
                let expected = format!("{}, as there are vertices", vertices.element.count);
                return Err(Fault::found("sh", format!("{} rows", harmonics.element.count), expected));
            }
            for (k, coefficient) in coefficients[1..functions(degree)].iter_mut().enumerate() {
                let value = |channel: usize| harmonic(bytes[channel * stored / 3 + k] as u8);
                *coefficient = Vec3::new(value(0), value(1), value(2));
            }
        }
        let [position, rotation, scale, color] = columns.map(|column| row[column] as u32);
        let color = color.to_be_bytes().map(|byte| f32::from(byte) / 255.0);
        let [a, b, c] = [20, 10, 0].map(|shift| (rotation >> shift & 0x3ff) as f32 / 1023.0);
        let gaussian = Gaussian {
            position: between(chunk.position, thirds(position)),
            scale: Vec3::from_array(between(chunk.scale, thirds(scale)).to_array().map(f32::exp)),
            rotation: without_largest([a, b, c], (rotation >> 30) as u8),
            opacity: color[3],
        };
        coefficients[0] = constant(between(chunk.color, Vec4::from_array(color).truncate()));
        splats.push(gaussian, &coefficients[..functions(degree)]);
    }
    Ok(splats)
}

fn chunks(ply: &Ply) -> Result<Vec<Chunk>, Fault> {
    let expected = "the ranges of a compressed .ply";
    let mut rows = ply.rows("chunk")?.ok_or_else(|| Fault::found("header", "no element `chunk`", expected))?;
    let column = |end: &str, name: &str| rows.element.number(&format!("{end}_{name}"));
    let columns = |names: [&str; 3]| ["min", "max"].map(|end| names.map(|name| column(end, name)));
    let positions = columns(["x", "y", "z"]);
    let scales = columns(["scale_x", "scale_y", "scale_z"]);
    let colors = columns(["r", "g", "b"]);
    if positions.iter().chain(&scales).flatten().any(Option::is_none) {
        let found = format!("{} properties", rows.element.properties.len());
        return Err(Fault::found("chunk", found, "min_x to max_scale_z"));
    }
    let mut chunks = Vec::with_capacity(rows.certain);
    let mut row = Vec::new();
    while rows.read(&mut row)? {
        // Earlier versions do not have the range of colors.
        let range = |columns: [[Option<usize>; 3]; 2]| {
            let value = |column: Option<usize>, missing| column.map_or(missing, |column| row[column] as f32);
            let [low, high] = columns;
            [Vec3::from_array(low.map(|low| value(low, 0.0))), Vec3::from_array(high.map(|high| value(high, 1.0)))]
        };
        chunks.push(Chunk { position: range(positions), scale: range(scales), color: range(colors) });
    }
    Ok(chunks)
}

fn between([low, high]: [Vec3; 2], part: Vec3) -> Vec3 {
    low + (high - low) * part
}

/// Unpacks fractions of 11, 10 and 11 bits.
fn thirds(packed: u32) -> Vec3 {
    let part = |shift: u32, most: u32| (packed >> shift & most) as f32 / most as f32;
    Vec3::new(part(21, 0x7ff), part(11, 0x3ff), part(0, 0x7ff))
}

fn harmonic(byte: u8) -> f32 {
    let part = match byte {
        0 => 0.0,
        255 => 1.0,
        _ => (f32::from(byte) + 0.5) / 256.0,
    };
    (part - 0.5) * HARMONICS
}
