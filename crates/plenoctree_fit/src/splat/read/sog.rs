//! SOG, PlayCanvas' images of quantized Gaussians, versions 1 and 2: a zip archive, or a folder.

use std::io::{Cursor, Read};

use glam::{Quat, Vec3};
use image_webp::WebPDecoder;
use serde::{Deserialize, Deserializer, de::Error};
use serde_json::Value;
use zip::{ZipArchive, result::ZipError};

use super::shared::{Beside, check_count, sigmoid, without_largest};
use crate::{
    file::{Fault, without_mark},
    splat::{
        harmonics::functions,
        splats::{Gaussian, Splats},
    },
};

/// Centroids in a row of their image.
const ROW: usize = 64;
/// Maximum number of centroids, which 16-bit labels refer to.
const MAX_CENTROIDS: usize = 1 << 16;
/// Largest `meta.json`.
const MAX_META: u64 = 1 << 20;

/// `meta.json` of either version.
#[derive(Deserialize)]
struct Meta {
    version: Option<u64>,
    /// `true`, or a `model` of `antialiased`, for captures that were trained so.
    antialias: Option<Value>,
    model: Option<Value>,
    /// In version 1, `means.shape` has it.
    count: Option<u64>,
    means: Means,
    scales: Values,
    quats: Files,
    sh0: Values,
    #[serde(rename = "shN")]
    sh_n: Option<Harmonics>,
}

#[derive(Deserialize)]
struct Means {
    shape: Option<Vec<u64>>,
    mins: [f32; 3],
    maxs: [f32; 3],
    files: Vec<String>,
}

#[derive(Deserialize)]
struct Files {
    files: Vec<String>,
}

/// Values by a codebook (version 2), or between bounds (version 1).
#[derive(Deserialize)]
struct Values {
    #[serde(default, deserialize_with = "codebook")]
    codebook: Option<Vec<f32>>,
    mins: Option<Vec<f32>>,
    maxs: Option<Vec<f32>>,
    files: Vec<String>,
}

#[derive(Deserialize)]
struct Harmonics {
    bands: Option<u32>,
    #[serde(default, deserialize_with = "codebook")]
    codebook: Option<Vec<f32>>,
    mins: Option<f32>,
    maxs: Option<f32>,
    files: Vec<String>,
}

/// Reads a codebook. Some writers made its first number null, which is as far below the second one as the others are
/// apart.
fn codebook<'de, D: Deserializer<'de>>(source: D) -> Result<Option<Vec<f32>>, D::Error> {
    let Some(mut values) = Option::<Vec<Option<f32>>>::deserialize(source)? else {
        return Ok(None);
    };
    if let [first @ None, Some(second), .., Some(last)] = &mut values[..] {
        *first = Some(*second + (*second - *last) / 255.0);
    }
    let values: Option<Vec<f32>> = values.into_iter().collect();
    values.map(Some).ok_or_else(|| D::Error::custom("found null in a codebook, expected a number"))
}

/// An image with four bytes a pixel.
struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 4]>,
}

/// Reads a `.sog` file.
pub fn read_bundle(bytes: &[u8]) -> Result<Splats, Fault> {
    let damaged = |error: ZipError| Fault::found("zip archive", error.to_string(), "a complete .sog bundle");
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(damaged)?;
    let named = |name: &str| {
        let is_named = |path: &&str| path.rsplit('/').next() == Some(name);
        archive.file_names().filter(is_named).map(str::to_string).collect::<Vec<_>>()
    };
    let metas = named("meta.json");
    let root = metas.iter().find(|meta| *meta == "meta.json");
    let meta = match (root, &metas[..]) {
        (Some(meta), _) | (None, [meta]) => meta.clone(),
        _ if metas.len() > 1 || !named("lod-meta.json").is_empty() => {
            return Err(streamed("zip archive"));
        }
        _ => return Err(Fault::found("zip archive", "no meta.json", "a .sog bundle")),
    };
    let folder = meta.trim_end_matches("meta.json").to_string();
    let mut member = |name: &str, most: u64| -> Result<Vec<u8>, Fault> {
        let damaged = |found: String| Fault::found(name, found, format!("a member of at most {most} bytes"));
        let path = format!("{folder}{name}");
        // `by_name` panics if a member only pretends to be encrypted.
        match archive.by_name_decrypt(&path, &[]).map(|member| member.is_ok()) {
            Ok(true) => {}
            Ok(false) => return Err(damaged("an encrypted member".into())),
            Err(error) => return Err(damaged(error.to_string())),
        }
        let member = archive.by_name(&path).map_err(|error| damaged(error.to_string()))?;
        let mut content = Vec::new();
        // The claimed size may be wrong.
        member.take(most + 1).read_to_end(&mut content).map_err(|error| damaged(error.to_string()))?;
        if content.len() as u64 > most {
            return Err(damaged("more".into()));
        }
        Ok(content)
    };
    let json = member("meta.json", MAX_META)?;
    let json = serde_json::from_slice(without_mark(&json))
        .map_err(|error| Fault::found("meta.json", error.to_string(), "the description of a SOG capture"))?;
    let size = bytes.len() as u64;
    // Images are compressed already.
    read_meta(json, size, &mut |name| member(name, 2 * size + MAX_META))
}

/// Returns the error that a file is a streamed SOG.
pub fn streamed(what: &str) -> Fault {
    let expected = "a capture of one level of detail: convert it with splat-transform";
    Fault::found(what, "a streamed SOG, which has several captures", expected)
}

/// Reads what `meta.json` describes. `size` is the size of the whole in bytes, as far as it is known.
pub fn read_meta(json: Value, mut size: u64, beside: Beside) -> Result<Splats, Fault> {
    let meta: Meta = serde_json::from_value(json)
        .map_err(|error| Fault::found("meta.json", error.to_string(), "the description of a SOG capture"))?;
    if let Some(version) = meta.version
        && version != 2
    {
        return Err(Fault::found("meta.json: version", version.to_string(), "2, or none for version 1"));
    }
    let shape = meta.means.shape.as_ref().and_then(|shape| shape.first().copied());
    let Some(count) = meta.count.or(shape) else {
        return Err(Fault::found("meta.json", "no count", "the number of Gaussians"));
    };
    let mut files: Vec<Vec<u8>> = Vec::new();
    let named = [(&meta.means.files, 2), (&meta.scales.files, 1), (&meta.quats.files, 1), (&meta.sh0.files, 1)];
    let harmonics = meta.sh_n.as_ref().map(|harmonics| (&harmonics.files, 2));
    for (names, needed) in named.into_iter().chain(harmonics) {
        if names.len() < needed {
            return Err(Fault::found("meta.json: files", format!("{} names", names.len()), format!("{needed} names")));
        }
        for name in &names[..needed] {
            files.push(beside(name)?);
        }
    }
    size += files.iter().map(|file| file.len() as u64).sum::<u64>();
    let count = check_count("meta.json: count", count, size)?;
    let image = |index: usize, name: &str| Image::decode(&files[index], name, count);
    let (low, high) = (image(0, &meta.means.files[0])?, image(1, &meta.means.files[1])?);
    let scales = image(2, &meta.scales.files[0])?;
    let quaternions = image(3, &meta.quats.files[0])?;
    let colors = image(4, &meta.sh0.files[0])?;
    let scale_values = meta.scales.tables("scales", 3)?;
    let color_values = meta.sh0.tables("sh0", if meta.sh0.codebook.is_some() { 3 } else { 4 })?;
    let palette = match &meta.sh_n {
        Some(harmonics) => Some(Palette::new(harmonics, &files[5], &files[6], count)?),
        None => None,
    };

    let mut splats = Splats::new(palette.as_ref().map_or(0, |palette| palette.degree));
    let (flag, model) = (meta.antialias, meta.model);
    splats.set_antialiased(flag == Some(true.into()) || model == Some("antialiased".into()));
    splats.reserve(count);
    let (mins, maxs) = (Vec3::from_array(meta.means.mins), Vec3::from_array(meta.means.maxs));
    let mut coefficients = [Vec3::ZERO; 16];
    for index in 0..count {
        let triple = |tables: &[[f32; 256]], bytes: [u8; 4]| {
            Vec3::from_array(std::array::from_fn(|axis| tables[axis][usize::from(bytes[axis])]))
        };
        let (low, high) = (low.pixels[index], high.pixels[index]);
        let place = Vec3::from_array(std::array::from_fn(|axis| {
            f32::from(u16::from_le_bytes([low[axis], high[axis]])) / 65535.0
        }));
        let logarithm = mins + (maxs - mins) * place;
        let color = colors.pixels[index];
        let gaussian = Gaussian {
            position: Vec3::from_array(logarithm.to_array().map(|log| log.abs().exp_m1().copysign(log))),
            scale: Vec3::from_array(triple(&scale_values, scales.pixels[index]).to_array().map(f32::exp)),
            rotation: rotation(quaternions.pixels[index]),
            // Version 1 has logits.
            opacity: match color_values.get(3) {
                Some(logits) => sigmoid(logits[usize::from(color[3])]),
                None => f32::from(color[3]) / 255.0,
            },
        };
        coefficients[0] = triple(&color_values, color);
        if let Some(palette) = &palette {
            palette.look_up(index, &mut coefficients[1..])?;
        }
        splats.push(gaussian, &coefficients[..functions(splats.degree())]);
    }
    Ok(splats)
}

impl Values {
    /// Returns the value of each byte, for each of `channels`.
    fn tables(&self, name: &str, channels: usize) -> Result<Vec<[f32; 256]>, Fault> {
        let name = format!("meta.json: {name}");
        if let Some(codebook) = &self.codebook {
            return Ok(vec![codebook_table(codebook, &name)?; channels]);
        }
        match (self.mins.as_deref(), self.maxs.as_deref()) {
            (Some(mins), Some(maxs)) if mins.len() >= channels && maxs.len() >= channels => {
                Ok(mins.iter().zip(maxs).take(channels).map(|(min, max)| between(*min, *max)).collect())
            }
            _ => Err(Fault::found(name, "neither", format!("a codebook, or {channels} mins and maxs"))),
        }
    }
}

fn codebook_table(codebook: &[f32], name: &str) -> Result<[f32; 256], Fault> {
    codebook
        .try_into()
        .map_err(|_| Fault::found(name, format!("a codebook of {} values", codebook.len()), "one of 256 values"))
}

fn between(min: f32, max: f32) -> [f32; 256] {
    std::array::from_fn(|byte| min + (max - min) * byte as f32 / 255.0)
}

/// Three parts of a quaternion, and which one is missing. The order is w, x, y, z.
fn rotation([a, b, c, tag]: [u8; 4]) -> Quat {
    let Some(largest) = tag.checked_sub(252) else { return Quat::IDENTITY };
    without_largest([a, b, c].map(|byte| f32::from(byte) / 255.0), largest)
}

/// The higher harmonics: a label for each Gaussian, and the coefficients of each label.
struct Palette {
    degree: u32,
    table: [f32; 256],
    labels: Image,
    centroids: Image,
}

impl Palette {
    fn new(harmonics: &Harmonics, centroids: &[u8], labels: &[u8], count: usize) -> Result<Self, Fault> {
        let name = "meta.json: shN";
        let table = match (&harmonics.codebook, harmonics.mins, harmonics.maxs) {
            (Some(codebook), ..) => codebook_table(codebook, name)?,
            (None, Some(min), Some(max)) => between(min, max),
            _ => return Err(Fault::found(name, "neither", "a codebook, or mins and maxs")),
        };
        let labels = Image::decode(labels, &harmonics.files[1], count)?;
        let (width, height) = Image::size(centroids, &harmonics.files[0])?;
        let degree = (1..=3).find(|&degree| width == ROW * (functions(degree) - 1));
        let Some(degree) = degree.filter(|degree| harmonics.bands.is_none_or(|bands| bands == *degree)) else {
            let expected = match harmonics.bands {
                Some(bands) => format!("64 times the harmonics of {bands} bands, 1 to 3"),
                None => "192, 512 or 960 pixels".into(),
            };
            return Err(Fault::found(harmonics.files[0].as_str(), format!("{width} pixels across"), expected));
        };
        if height > MAX_CENTROIDS / ROW {
            return Err(Fault::found(harmonics.files[0].as_str(), format!("{height} rows"), "at most 1024"));
        }
        let centroids = Image::decode_sized(centroids, &harmonics.files[0])?;
        Ok(Self { degree, table, labels, centroids })
    }

    fn look_up(&self, index: usize, coefficients: &mut [Vec3]) -> Result<(), Fault> {
        let [low, high, ..] = self.labels.pixels[index];
        let label = usize::from(u16::from_le_bytes([low, high]));
        let count = functions(self.degree) - 1;
        let first = label / ROW * self.centroids.width + label % ROW * count;
        let Some(pixels) = self.centroids.pixels.get(first..first + count) else {
            let found = format!("label {label} of Gaussian {index}");
            return Err(Fault::found("shN", found, format!("one of {} rows of 64", self.centroids.height)));
        };
        for (coefficient, pixel) in coefficients.iter_mut().zip(pixels) {
            *coefficient = Vec3::from_array(std::array::from_fn(|channel| self.table[usize::from(pixel[channel])]));
        }
        Ok(())
    }
}

impl Image {
    /// Decodes an image with a pixel for each Gaussian.
    fn decode(bytes: &[u8], name: &str, count: usize) -> Result<Self, Fault> {
        let (width, height) = Self::size(bytes, name)?;
        // Images are about square, with little that is not used.
        let most = 4 * count + (1 << 16);
        if !(count..=most).contains(&width.saturating_mul(height)) {
            let found = format!("{width}x{height} pixels");
            return Err(Fault::found(name, found, format!("{count} to {most} pixels")));
        }
        Self::decode_sized(bytes, name)
    }

    fn size(bytes: &[u8], name: &str) -> Result<(usize, usize), Fault> {
        let (width, height) = Self::decoder(bytes, name)?.dimensions();
        Ok((width as usize, height as usize))
    }

    fn decoder<'a>(bytes: &'a [u8], name: &str) -> Result<WebPDecoder<Cursor<&'a [u8]>>, Fault> {
        WebPDecoder::new(Cursor::new(bytes)).map_err(|error| damaged(name, error))
    }

    /// Decodes an image whose size has been checked.
    fn decode_sized(bytes: &[u8], name: &str) -> Result<Self, Fault> {
        let mut decoder = Self::decoder(bytes, name)?;
        let (width, height) = decoder.dimensions();
        let (width, height) = (width as usize, height as usize);
        let channels = if decoder.has_alpha() { 4 } else { 3 };
        decoder.set_memory_limit(16 * width * height + (1 << 20));
        let mut buffer = vec![0; channels * width * height];
        decoder.read_image(&mut buffer).map_err(|error| damaged(name, error))?;
        let pixel = |bytes: &[u8]| [bytes[0], bytes[1], bytes[2], bytes.get(3).copied().unwrap_or(255)];
        Ok(Self { width, height, pixels: buffer.chunks_exact(channels).map(pixel).collect() })
    }
}

fn damaged(name: &str, error: image_webp::DecodingError) -> Fault {
    Fault::found(name, error.to_string(), "a WebP image")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codebook_of(numbers: &str) -> Option<Vec<f32>> {
        let values: Values = serde_json::from_str(&format!(r#"{{"codebook": {numbers}, "files": []}}"#)).ok()?;
        values.codebook
    }

    /// Some writers made the first number of a codebook null. Other nulls are errors.
    #[test]
    fn a_codebook_may_begin_with_null() {
        assert_eq!(codebook_of("[1.0, 2.0, 3.0]"), Some(vec![1.0, 2.0, 3.0]));
        assert_eq!(codebook_of("[null, 2.0, 257.0]"), Some(vec![1.0, 2.0, 257.0]));
        assert_eq!(codebook_of("null"), None);
        for wrong in ["[1.0, null, 3.0]", "[null, null, 3.0]", "[null]"] {
            assert_eq!(codebook_of(wrong), None, "{wrong}");
        }
    }
}
