//! Animated PNG files, which browsers show like any picture.

use std::{fs::File, io::BufWriter, path::Path};

use image::RgbaImage;
use png::{BitDepth, ColorType, Encoder};

use crate::Result;

/// Frames per second.
const RATE: u16 = 12;

/// Writes frames of one size as an animation that repeats.
pub fn write(file: &Path, frames: &[RgbaImage]) -> Result {
    let (width, height) = frames.first().ok_or("there are no frames")?.dimensions();
    let mut encoder = Encoder::new(BufWriter::new(File::create(file)?), width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_animated(frames.len() as u32, 0)?;
    encoder.set_frame_delay(1, RATE)?;
    let mut writer = encoder.write_header()?;
    for frame in frames {
        let opaque: Vec<u8> = frame.pixels().flat_map(|pixel| [pixel.0[0], pixel.0[1], pixel.0[2]]).collect();
        writer.write_image_data(&opaque)?;
    }
    Ok(writer.finish()?)
}
