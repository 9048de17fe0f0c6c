//! Reads pictures and masks.

use std::{
    fs::{self, File},
    io::{BufRead, BufReader},
    path::Path,
};

use glam::DVec2;
use image::{DynamicImage, GrayImage, ImageDecoder, ImageReader, Luma, RgbImage, metadata::Orientation};
use zune_jpeg::{
    JpegDecoder,
    zune_core::{colorspace::ColorSpace, options::DecoderOptions},
};

use crate::fit::error::FitError;

/// Largest width and height of a picture, in pixels.
const MAX_SIZE: u32 = 1 << 15;
/// Largest number of pixels of a picture.
const MAX_PIXELS: u64 = 1 << 27;

/// A picture in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
    /// Encoded sRGB, premultiplied by opacity, and opacity, row by row.
    pub pixels: Vec<[u8; 4]>,
    /// Whether any pixel is not opaque, or there is a mask.
    pub knows_opacity: bool,
}

impl Picture {
    /// Reads a picture, and averages squares of `downscale` pixels a side (0 counts as 1). The mask's brightness, or
    /// its own opacity if it is partly transparent, multiplies the picture's opacity. Masks of zeros and ones are as
    /// good as black and white ones.
    ///
    /// # Errors
    ///
    /// Returns an error if a file cannot be read or decoded, or if the mask has another size.
    pub fn read(path: &Path, mask: Option<&Path>, downscale: u32) -> Result<Self, FitError> {
        let downscale = downscale.max(1);
        let image = decode(path)?;
        let mask = mask.map(|path| Ok::<_, FitError>((path, read_mask(path)?))).transpose()?;
        let mut knows_opacity = mask.is_some();
        let mut rgba = image.into_rgba8();
        if let Some((path, mask)) = &mask {
            if mask.dimensions() != rgba.dimensions() {
                let found = format!("{:?}", mask.dimensions());
                return Err(FitError::found(path, "size of the mask", found, format!("{:?}", rgba.dimensions())));
            }
            for (pixel, mask) in rgba.pixels_mut().zip(mask.pixels()) {
                pixel[3] = (u16::from(pixel[3]) * u16::from(mask[0]) / 255) as u8;
            }
        }
        knows_opacity |= rgba.pixels().any(|pixel| pixel[3] < 255);
        let (width, height) = ((rgba.width() / downscale).max(1), (rgba.height() / downscale).max(1));
        let mut pixels = Vec::with_capacity((width * height) as usize);
        let (across, down) = (downscale.min(rgba.width()), downscale.min(rgba.height()));
        // In units of 1 / 255^2, so that premultiplying and averaging round only once.
        let divisor = 255 * u64::from(across * down);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0u64; 4];
                for (dy, dx) in (0..down).flat_map(|dy| (0..across).map(move |dx| (dy, dx))) {
                    let [r, g, b, a] = rgba.get_pixel(x * across + dx, y * down + dy).0.map(u64::from);
                    sum = [sum[0] + r * a, sum[1] + g * a, sum[2] + b * a, sum[3] + 255 * a];
                }
                pixels.push(sum.map(|sum| ((sum + divisor / 2) / divisor) as u8));
            }
        }
        Ok(Self { width, height, pixels, knows_opacity })
    }

    /// Returns a pixel, in numbers from 0 to 1.
    pub(in crate::fit) fn pixel(&self, x: u32, y: u32) -> [f32; 4] {
        self.pixels[(y * self.width + x) as usize].map(|byte| f32::from(byte) / 255.0)
    }
}

/// Reads a mask: 255 shows the object.
pub fn read_mask(path: &Path) -> Result<GrayImage, FitError> {
    let image = decode(path)?;
    if image.color().has_alpha() {
        let rgba = image.to_rgba8();
        if rgba.pixels().any(|pixel| pixel[3] < 255) {
            return Ok(GrayImage::from_fn(rgba.width(), rgba.height(), |x, y| Luma([rgba.get_pixel(x, y)[3]])));
        }
    }
    let mut mask = image.into_luma8();
    if mask.iter().all(|value| *value <= 1) {
        mask.iter_mut().for_each(|value| *value *= 255);
    }
    Ok(mask)
}

/// Returns the width and the height of a picture, as it is stored, without decoding it.
pub fn size(path: &Path) -> Result<(u32, u32), FitError> {
    Decoder::open(path).map(|(size, _)| size)
}

/// Returns how many times as wide and as high as the `stated` size a picture is, if one is a scaled copy of the other,
/// with sides that are rounded to pixels.
pub fn scale(size: (u32, u32), stated: (f64, f64)) -> Option<DVec2> {
    let (size, stated) = (DVec2::new(size.0.into(), size.1.into()), DVec2::from(stated));
    let is_copy = |copy: DVec2, of: DVec2| {
        let (least, most) = ((copy - 1.0) / of, (copy + 1.0) / of);
        least.x < most.y && least.y < most.x
    };
    let is_scaled = stated.min_element() >= 1.0 && (is_copy(size, stated) || is_copy(stated, size));
    (size == stated || is_scaled).then(|| size / stated)
}

/// Says that pictures are scaled, for a warning.
pub fn scaled_note((width, height): (u32, u32), stated: (f64, f64)) -> String {
    format!("pictures are scaled, such as to {width}x{height} from {}x{}, and so are their lenses", stated.0, stated.1)
}

/// Returns how a picture is to be turned before it is shown, as its EXIF data says.
pub fn orientation(path: &Path) -> Orientation {
    let orientation = match Decoder::open(path) {
        Ok((_, Decoder::Jpeg(decoder))) => decoder.exif().and_then(|exif| Orientation::from_exif_chunk(exif)),
        Ok((_, Decoder::Png(mut decoder))) => decoder.orientation().ok(),
        Err(_) => None,
    };
    orientation.unwrap_or(Orientation::NoTransforms)
}

/// Reads a whole picture.
fn decode(path: &Path) -> Result<DynamicImage, FitError> {
    let ((width, height), decoder) = Decoder::open(path)?;
    match decoder {
        Decoder::Jpeg(mut decoder) => {
            // The decoder would show what is missing as gray.
            if is_cut_off(&fs::read(path).map_err(FitError::io(path))?) {
                return Err(damaged(path, "the file is truncated"));
            }
            let pixels = decoder.decode().map_err(|error| damaged(path, error))?;
            RgbImage::from_raw(width, height, pixels)
                .map(DynamicImage::from)
                .ok_or_else(|| damaged(path, "too few pixels"))
        }
        Decoder::Png(mut decoder) => {
            let mut limits = image::Limits::default();
            // Four channels of 16 bits.
            limits.max_alloc = Some(8 * MAX_PIXELS);
            limits
                .reserve(decoder.total_bytes())
                .and_then(|()| decoder.set_limits(limits))
                .and_then(|()| DynamicImage::from_decoder(decoder))
                .map_err(|error| damaged(path, error))
        }
    }
}

/// Returns whether the data of a JPEG file has no end.
fn is_cut_off(bytes: &[u8]) -> bool {
    const START_OF_SCAN: u8 = 0xda;
    const END_OF_IMAGE: [u8; 2] = [0xff, 0xd9];
    // Segments before the data may hold a thumbnail, which has an end, too.
    let mut at = 2;
    while let Some(&[0xff, marker, high, low]) = bytes.get(at..at + 4) {
        if marker == START_OF_SCAN {
            return !bytes[at..].windows(2).any(|pair| pair == END_OF_IMAGE);
        }
        at += if marker == 0xff { 1 } else { 2 + usize::from(u16::from_be_bytes([high, low])) };
    }
    // The decoder knows better.
    false
}

/// An open picture, whose size is read and valid.
enum Decoder {
    Jpeg(Box<JpegDecoder<BufReader<File>>>),
    Png(Box<dyn ImageDecoder>),
}

impl Decoder {
    /// Opens a picture, and returns its width and height with it. The name of the file may be wrong about the format.
    fn open(path: &Path) -> Result<((u32, u32), Self), FitError> {
        let mut file = BufReader::new(File::open(path).map_err(FitError::io(path))?);
        let start = file.fill_buf().map_err(FitError::io(path))?;
        let is_jpeg = start.starts_with(&[0xff, 0xd8]);
        if [b"ftyphe", b"ftypmi", b"ftypms"].iter().any(|brand| start.get(4..10) == Some(&brand[..])) {
            return Err(FitError::found(path, "picture", "a HEIC picture", "a PNG or JPEG file: convert it"));
        }
        // Decoders do not limit sizes: that happens below, with a message that says what is possible.
        let ((width, height), decoder) = if is_jpeg {
            let options = DecoderOptions::default()
                .jpeg_set_out_colorspace(ColorSpace::RGB)
                .set_max_width(usize::MAX)
                .set_max_height(usize::MAX);
            let mut decoder = JpegDecoder::new_with_options(file, options);
            decoder.decode_headers().map_err(|error| damaged(path, error))?;
            let (width, height) = decoder.dimensions().ok_or_else(|| damaged(path, "no size"))?;
            ((width as u32, height as u32), Self::Jpeg(Box::new(decoder)))
        } else {
            let mut reader = ImageReader::new(file).with_guessed_format().map_err(FitError::io(path))?;
            reader.no_limits();
            let decoder = reader.into_decoder().map_err(|error| damaged(path, error))?;
            (decoder.dimensions(), Self::Png(Box::new(decoder)))
        };
        if width.max(height) > MAX_SIZE || u64::from(width) * u64::from(height) > MAX_PIXELS {
            let expected = format!("at most {MAX_SIZE} pixels a side and {MAX_PIXELS} in all");
            return Err(FitError::found(path, "size", format!("{width}x{height}"), expected));
        }
        Ok(((width, height), decoder))
    }
}

fn damaged(path: &Path, error: impl std::fmt::Display) -> FitError {
    // Decoders' messages have quotes and line breaks.
    let error = error.to_string();
    let words: Vec<&str> =
        error.split(|c: char| c.is_whitespace() || c == '"').filter(|word| !word.is_empty()).collect();
    FitError::found(path, "picture", words.join(" "), "a PNG or JPEG file")
}

#[cfg(test)]
mod tests {
    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

    use super::*;

    /// The orientation is what EXIF data says, in JPEG and PNG files, and none without it.
    #[test]
    fn orientations_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture");
        let written = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            orientation(&path)
        };
        for (number, expected) in
            [(1, Orientation::NoTransforms), (6, Orientation::Rotate90), (8, Orientation::Rotate270)]
        {
            // A directory with one entry: the tag 0x112, of one 16-bit number.
            let exif =
                [b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(), &[number, 0, 0, 0, 0, 0, 0, 0]].concat();
            let mut png = Vec::new();
            let mut encoder = PngEncoder::new(&mut png);
            encoder.set_exif_metadata(exif.clone()).unwrap();
            encoder.write_image(&[0; 3], 1, 1, ExtendedColorType::Rgb8).unwrap();
            assert_eq!(written(&png), expected);
            let length = (2 + 6 + exif.len()) as u16;
            let segment = [&[0xff, 0xe1][..], &length.to_be_bytes(), b"Exif\0\0", &exif].concat();
            let frame = [0xff, 0xc0, 0, 11, 8, 0, 3, 0, 4, 1, 1, 0x11, 0];
            let scan = [0xff, 0xda, 0, 8, 1, 1, 0, 0, 63, 0];
            assert_eq!(written(&[&[0xff, 0xd8][..], &segment, &frame, &scan].concat()), expected);
            assert_eq!(written(&[&[0xff, 0xd8][..], &frame, &scan].concat()), Orientation::NoTransforms);
        }
    }

    /// Sides of scaled copies are rounded, up or down. Other sizes are not those of a copy.
    #[test]
    fn scaled_copies_are_told_from_others() {
        let is_copy = |size, stated| scale(size, stated).is_some();
        // Of Mip-NeRF 360, of Inria's examples, and the same size.
        for (size, stated) in [
            ((1297, 840), (5187.0, 3361.0)),
            ((979, 546), (1957.0, 1091.0)),
            ((5187, 3361), (1297.0, 840.0)),
            ((7, 9), (7.0, 9.0)),
        ] {
            assert!(is_copy(size, stated), "{size:?} {stated:?}");
        }
        for (size, stated) in [
            ((979, 550), (1957.0, 1091.0)),
            ((1091, 1957), (1957.0, 1091.0)),
            ((40, 40), (40.0, f64::NAN)),
            ((40, 40), (-40.0, -40.0)),
            ((1, 1), (0.0, 0.0)),
        ] {
            assert!(!is_copy(size, stated), "{size:?} {stated:?}");
        }
        assert_eq!(scale((50, 20), (100.0, 40.0)), Some(DVec2::splat(0.5)));
    }

    /// The end of a thumbnail is not that of the picture.
    #[test]
    fn pictures_without_an_end_are_cut_off() {
        let thumbnail = [0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9];
        let scan = [0xff, 0xda, 0, 8, 1, 1, 0, 0, 63, 0, 17, 0xff, 0, 42];
        let picture = [&[0xff, 0xd8][..], &thumbnail, &scan, &[0xff, 0xd9]].concat();
        assert!(!is_cut_off(&picture));
        assert!(!is_cut_off(&[&picture[..], b"more of the camera's"].concat()));
        assert!((24..picture.len()).all(|end| is_cut_off(&picture[..end])));
    }
}
