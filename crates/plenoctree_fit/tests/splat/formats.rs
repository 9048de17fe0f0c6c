//! Writes captures in every format that is read.

use std::io::{Cursor, Write};

use flate2::{Compression, write::GzEncoder};
use glam::Vec3;
use image_webp::{ColorType, WebPEncoder};
use plenoctree_fit::splat::{Gaussian, Splats};
use serde_json::{Value, json};
use zip::{ZipWriter, write::FileOptions};

/// The properties of a `.ply` file, by name.
fn properties(splats: &Splats, index: usize) -> Vec<(String, f32)> {
    let Gaussian { position, scale, rotation, opacity } = splats.gaussians()[index];
    let coefficients = splats.coefficients(index);
    let mut properties: Vec<(String, f32)> = Vec::new();
    let mut add = |name: String, value: f32| properties.push((name, value));
    add("x".into(), position.x);
    add("y".into(), position.y);
    add("z".into(), position.z);
    (0..3).for_each(|axis| add(format!("f_dc_{axis}"), coefficients[0][axis]));
    let rest = coefficients.len() - 1;
    for (channel, k) in (0..3).flat_map(|channel| (0..rest).map(move |k| (channel, k))) {
        add(format!("f_rest_{}", channel * rest + k), coefficients[1 + k][channel]);
    }
    add("opacity".into(), logit(opacity));
    (0..3).for_each(|axis| add(format!("scale_{axis}"), scale[axis].ln()));
    // Not of unit length, as trainers leave them.
    let [x, y, z, w] = rotation.to_array().map(|part| 1.7 * part);
    [w, x, y, z].into_iter().enumerate().for_each(|(part, value)| add(format!("rot_{part}"), value));
    properties
}

fn logit(opacity: f32) -> f32 {
    (opacity / (1.0 - opacity)).ln()
}

/// How numbers of a `.ply` file are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlyFormat {
    Ascii,
    Little,
    Big,
    /// Properties in reverse order, as doubles, with unknown properties and elements.
    Strange,
}

pub fn ply(splats: &Splats, format: PlyFormat) -> Vec<u8> {
    let name = match format {
        PlyFormat::Ascii => "ascii",
        PlyFormat::Big => "binary_big_endian",
        _ => "binary_little_endian",
    };
    let mut bytes = format!("ply\nformat {name} 1.0\ncomment by hand\n").into_bytes();
    if format == PlyFormat::Strange {
        bytes.extend(b"element camera 2\nproperty uchar id\nproperty list uchar short values\n");
    }
    bytes.extend(format!("element vertex {}\n", splats.len()).bytes());
    let rows: Vec<Vec<(String, f32)>> = (0..splats.len())
        .map(|index| {
            let mut row = properties(splats, index);
            if format == PlyFormat::Strange {
                row.reverse();
            }
            row
        })
        .collect();
    for (name, _) in &rows[0] {
        let kind = if format == PlyFormat::Strange { "double" } else { "float" };
        bytes.extend(format!("property {kind} {name}\n").bytes());
    }
    if format == PlyFormat::Strange {
        bytes.extend(b"property uchar red\nproperty list uint8 int32 neighbors\n");
    }
    bytes.extend(b"element face 1\nproperty list uchar int vertex_index\nend_header\n");
    if format == PlyFormat::Strange {
        // Two cameras: an id, and a list of two and of no numbers.
        bytes.extend([7, 2, 1, 0, 2, 0, 8, 0]);
    }
    for row in &rows {
        for (_, value) in row {
            match format {
                PlyFormat::Ascii => bytes.extend(format!("{value:?} ").bytes()),
                PlyFormat::Little => bytes.extend(value.to_le_bytes()),
                PlyFormat::Big => bytes.extend(value.to_be_bytes()),
                PlyFormat::Strange => bytes.extend(f64::from(*value).to_le_bytes()),
            }
        }
        match format {
            PlyFormat::Ascii => bytes.push(b'\n'),
            PlyFormat::Strange => bytes.extend([255, 1, 9, 0, 0, 0]),
            _ => {}
        }
    }
    match format {
        PlyFormat::Ascii => bytes.extend(b"3 0 1 2\n"),
        _ => bytes.extend([0]),
    }
    bytes
}

/// A compressed `.ply` file of PlayCanvas' tools. Earlier versions do not have the range of colors.
pub fn packed_ply(splats: &Splats, has_color_range: bool) -> Vec<u8> {
    let gaussians = splats.gaussians();
    let color = |index: usize| 0.5 + 0.282_094_8 * splats.coefficients(index)[0];
    let logs = |index: usize| Vec3::from_array(gaussians[index].scale.to_array().map(f32::ln));
    let ends = |values: &dyn Fn(usize) -> Vec3, chunk: &[usize]| {
        let values = chunk.iter().map(|index| values(*index));
        [values.clone().fold(Vec3::MAX, Vec3::min), values.fold(Vec3::MIN, Vec3::max)]
    };
    let unit = |[low, high]: [Vec3; 2], value: Vec3| (value - low) / (high - low).max(Vec3::splat(1e-9));
    let packed = |part: Vec3| {
        let [x, y, z] = [part.x * 2047.0, part.y * 1023.0, part.z * 2047.0].map(|part| part.round() as u32);
        x << 21 | y << 11 | z
    };
    let all: Vec<usize> = (0..splats.len()).collect();
    let (mut chunks, mut vertices, mut harmonics) = (Vec::<f32>::new(), Vec::<u32>::new(), Vec::<u8>::new());
    for chunk in all.chunks(256) {
        let position = ends(&|index| gaussians[index].position, chunk);
        let scale = ends(&logs, chunk);
        let colors = if has_color_range { ends(&color, chunk) } else { [Vec3::ZERO, Vec3::ONE] };
        let ranges = [position, scale, colors];
        chunks
            .extend(ranges[..if has_color_range { 3 } else { 2 }].as_flattened().iter().flat_map(|end| end.to_array()));
        for &index in chunk {
            let Gaussian { position: at, rotation, opacity, .. } = gaussians[index];
            let [x, y, z, w] = rotation.to_array();
            let parts = [w, x, y, z];
            let largest = (0..4).max_by(|&a, &b| parts[a].abs().total_cmp(&parts[b].abs())).unwrap();
            let sign = parts[largest].signum();
            let turn = (0..4).filter(|part| *part != largest).fold(largest as u32, |turn, part| {
                turn << 10 | ((sign * parts[part] / 2.0f32.sqrt() + 0.5) * 1023.0).round() as u32
            });
            let [r, g, b] = unit(colors, color(index)).to_array().map(|part| byte(255.0 * part));
            let color = u32::from_be_bytes([r, g, b, byte(255.0 * opacity)]);
            vertices.extend([packed(unit(position, at)), turn, packed(unit(scale, logs(index))), color]);
            let rest = &splats.coefficients(index)[1..];
            harmonics.extend((0..3).flat_map(|channel| {
                rest.iter().map(move |k| ((k[channel] / 8.0 + 0.5) * 256.0).floor().clamp(0.0, 255.0) as u8)
            }));
        }
    }
    let properties =
        |kind: &str, names: &[String]| names.iter().map(|name| format!("property {kind} {name}\n")).collect::<String>();
    let columns = |names: [&str; 3]| ["min", "max"].map(|end| names.map(|name| format!("{end}_{name}"))).concat();
    let mut ranges = [columns(["x", "y", "z"]), columns(["scale_x", "scale_y", "scale_z"])].concat();
    if has_color_range {
        ranges.extend(columns(["r", "g", "b"]));
    }
    let packed = ["position", "rotation", "scale", "color"].map(|name| format!("packed_{name}"));
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement chunk {}\n", splats.len().div_ceil(256));
    header += &properties("float", &ranges);
    header += &format!("element vertex {}\n{}", splats.len(), properties("uint", &packed));
    if !harmonics.is_empty() {
        let names: Vec<String> = (0..harmonics.len() / splats.len()).map(|index| format!("f_rest_{index}")).collect();
        header += &format!("element sh {}\n{}", splats.len(), properties("uchar", &names));
    }
    let mut bytes = (header + "end_header\n").into_bytes();
    bytes.extend(chunks.iter().flat_map(|value| value.to_le_bytes()));
    bytes.extend(vertices.iter().flat_map(|value| value.to_le_bytes()));
    bytes.extend(harmonics);
    bytes
}

/// A `.splat` file. It has no higher harmonics.
pub fn splat(splats: &Splats) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (index, gaussian) in splats.gaussians().iter().enumerate() {
        let Gaussian { position, scale, rotation, opacity } = *gaussian;
        bytes.extend([position, scale].iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes));
        let color = 0.5 + 0.282_094_8 * splats.coefficients(index)[0];
        bytes.extend(color.extend(opacity).to_array().map(|part| byte(255.0 * part)));
        let [x, y, z, w] = rotation.to_array();
        bytes.extend([w, x, y, z].map(|part| byte(128.0 * part + 128.0)));
    }
    bytes
}

fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// The planes of an SPZ file, of Gaussians whose axes are right, up and back.
fn planes(splats: &Splats, version: u32) -> [Vec<u8>; 6] {
    let mut planes: [Vec<u8>; 6] = Default::default();
    for (index, gaussian) in splats.gaussians().iter().enumerate() {
        let Gaussian { position, scale, rotation, opacity } = *gaussian;
        for coordinate in position.to_array() {
            planes[0].extend(&((coordinate * 4096.0).round() as i32).to_le_bytes()[..3]);
        }
        planes[1].push(byte(255.0 * opacity));
        let coefficients = splats.coefficients(index);
        planes[2].extend(coefficients[0].to_array().map(|dc| byte(dc * 0.15 * 255.0 + 127.5)));
        planes[3].extend(scale.to_array().map(|scale| byte((scale.ln() + 10.0) * 16.0)));
        let parts = rotation.to_array();
        if version == 2 {
            let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
            planes[4].extend([0, 1, 2].map(|part| byte(127.5 + sign * 127.5 * parts[part])));
        } else {
            let largest = (0..4).max_by(|&a, &b| parts[a].abs().total_cmp(&parts[b].abs())).unwrap();
            let mut packed = largest as u32;
            for part in (0..4).filter(|part| *part != largest) {
                let size = (511.0 * parts[part].abs() * 2.0f32.sqrt() + 0.5) as u32;
                let negative = u32::from((parts[part] < 0.0) != (parts[largest] < 0.0));
                packed = packed << 10 | negative << 9 | size;
            }
            planes[4].extend(packed.to_le_bytes());
        }
        for coefficient in &coefficients[1..] {
            planes[5].extend(coefficient.to_array().map(|k| byte(128.0 * k + 128.0)));
        }
    }
    planes
}

fn spz_start(splats: &Splats, version: u32, flags: u8) -> Vec<u8> {
    let mut bytes = b"NGSP".to_vec();
    bytes.extend(version.to_le_bytes());
    bytes.extend((splats.len() as u32).to_le_bytes());
    bytes.extend([splats.degree() as u8, 12, flags]);
    bytes
}

/// SPZ of Gaussians that are already turned to its axes. `axes` is the number of other axes, to be recorded.
pub fn spz(splats: &Splats, version: u32, axes: Option<u32>) -> Vec<u8> {
    let planes = planes(splats, version);
    // Two extensions: an unknown one, and the axes.
    let extensions = axes.map_or_else(Vec::new, |axes| {
        let words = [0x1234_0001, 3].into_iter().flat_map(u32::to_le_bytes).chain([1, 2, 3]);
        words.chain([0xadbe_0003, 4, axes].into_iter().flat_map(u32::to_le_bytes)).collect()
    });
    let mut bytes = spz_start(splats, version, if axes.is_some() { 2 } else { 0 });
    if version < 4 {
        bytes.push(0);
        planes.iter().for_each(|plane| bytes.extend(plane));
        bytes.extend(&extensions);
        return gzip(&bytes);
    }
    let streams: Vec<(Vec<u8>, usize)> = (planes.iter().filter(|plane| !plane.is_empty()))
        .map(|plane| {
            let packed = ruzstd::encoding::compress_to_vec(&plane[..], ruzstd::encoding::CompressionLevel::Fastest);
            (packed, plane.len())
        })
        .collect();
    bytes.push(streams.len() as u8);
    bytes.extend((32 + extensions.len() as u32).to_le_bytes());
    bytes.extend([0; 12]);
    bytes.extend(extensions);
    for (packed, size) in &streams {
        bytes.extend([packed.len() as u64, *size as u64].into_iter().flat_map(u64::to_le_bytes));
    }
    streams.iter().for_each(|(packed, _)| bytes.extend(packed));
    bytes
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A quantizer by a codebook, and its values.
fn quantizer(values: impl Iterator<Item = f32> + Clone) -> (impl Fn(f32) -> u8, Vec<f32>) {
    let (low, high) = (values.clone().fold(f32::MAX, f32::min), values.fold(f32::MIN, f32::max));
    let codebook: Vec<f32> = (0..256).map(|code| low + (high - low) * code as f32 / 255.0).collect();
    (move |value| byte((value - low) / (high - low).max(1e-9) * 255.0), codebook)
}

fn webp(width: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut pixels = pixels.to_vec();
    pixels.resize(pixels.len().next_multiple_of(width as usize), [0, 0, 0, 255]);
    let mut bytes = Vec::new();
    let height = pixels.len() as u32 / width;
    WebPEncoder::new(&mut bytes).encode(pixels.as_flattened(), width, height, ColorType::Rgba8).unwrap();
    bytes
}

/// The files of SOG, `meta.json` first.
pub fn sog(splats: &Splats, version: u32) -> Vec<(String, Vec<u8>)> {
    const WIDTH: u32 = 8;
    let gaussians = splats.gaussians();
    let logarithm = |x: f32| x.abs().ln_1p().copysign(x);
    let logs: Vec<Vec3> = gaussians.iter().map(|g| Vec3::from_array(g.position.to_array().map(logarithm))).collect();
    let low = logs.iter().fold(Vec3::MAX, |low, log| low.min(*log));
    let high = logs.iter().fold(Vec3::MIN, |high, log| high.max(*log));
    let words: Vec<[u16; 3]> = logs
        .iter()
        .map(|log| ((log - low) / (high - low).max(Vec3::splat(1e-9)) * 65535.0).round().to_array().map(|x| x as u16))
        .collect();
    let half = |shift: u32| -> Vec<[u8; 4]> {
        words.iter().map(|[x, y, z]| [(x >> shift) as u8, (y >> shift) as u8, (z >> shift) as u8, 255]).collect()
    };
    let quaternions: Vec<[u8; 4]> = (gaussians.iter())
        .map(|gaussian| {
            let [x, y, z, w] = gaussian.rotation.to_array();
            let parts = [w, x, y, z];
            let largest = (0..4).max_by(|&a, &b| parts[a].abs().total_cmp(&parts[b].abs())).unwrap();
            let sign = if parts[largest] < 0.0 { -1.0 } else { 1.0 };
            let mut rest = (0..4).filter(|part| *part != largest);
            let mut next = || byte((sign * parts[rest.next().unwrap()] * 2.0f32.sqrt() + 1.0) / 2.0 * 255.0);
            [next(), next(), next(), 252 + largest as u8]
        })
        .collect();
    let (scale_code, scale_codebook) = quantizer(gaussians.iter().flat_map(|g| g.scale.to_array().map(f32::ln)));
    let scales: Vec<[u8; 4]> = (gaussians.iter())
        .map(|gaussian| {
            let [a, b, c] = gaussian.scale.to_array().map(|scale| scale_code(scale.ln()));
            [a, b, c, 255]
        })
        .collect();
    let (color_code, color_codebook) =
        quantizer((0..splats.len()).flat_map(|index| splats.coefficients(index)[0].to_array()));
    let (logit_code, logit_values) = quantizer(gaussians.iter().map(|gaussian| logit(gaussian.opacity)));
    let colors: Vec<[u8; 4]> = (0..splats.len())
        .map(|index| {
            let [r, g, b] = splats.coefficients(index)[0].to_array().map(&color_code);
            let opacity = gaussians[index].opacity;
            [r, g, b, if version == 1 { logit_code(logit(opacity)) } else { byte(255.0 * opacity) }]
        })
        .collect();
    let mut files = vec![
        ("means_l.webp".to_string(), webp(WIDTH, &half(0))),
        ("means_u.webp".to_string(), webp(WIDTH, &half(8))),
        ("scales.webp".to_string(), webp(WIDTH, &scales)),
        ("quats.webp".to_string(), webp(WIDTH, &quaternions)),
        ("sh0.webp".to_string(), webp(WIDTH, &colors)),
    ];
    let bounds =
        |codebook: &[f32], count: usize| -> [Value; 2] { [codebook[0], codebook[255]].map(|x| json!(vec![x; count])) };
    let [scale_low, scale_high] = bounds(&scale_codebook, 3);
    let [mut color_low, mut color_high] = bounds(&color_codebook, 3);
    color_low.as_array_mut().unwrap().push(json!(logit_values[0]));
    color_high.as_array_mut().unwrap().push(json!(logit_values[255]));
    let means = json!({"mins": low.to_array(), "maxs": high.to_array(), "files": ["means_l.webp", "means_u.webp"]});
    let mut meta = match version {
        1 => json!({
            "means": means,
            "scales": {"mins": scale_low, "maxs": scale_high, "files": ["scales.webp"]},
            "quats": {"files": ["quats.webp"]},
            "sh0": {"mins": color_low, "maxs": color_high, "files": ["sh0.webp"]},
        }),
        _ => json!({
            "version": 2, "count": splats.len(), "means": means,
            "scales": {"codebook": scale_codebook, "files": ["scales.webp"]},
            "quats": {"files": ["quats.webp"]},
            "sh0": {"codebook": color_codebook, "files": ["sh0.webp"]},
        }),
    };
    if version == 1 {
        meta["means"]["shape"] = json!([splats.len(), 3]);
    }
    let rest = splats.coefficients(0).len() - 1;
    if rest > 0 {
        let all = (0..splats.len()).flat_map(|index| splats.coefficients(index)[1..].iter().flat_map(|k| k.to_array()));
        let (code, codebook) = quantizer(all);
        let names = ["shN_centroids.webp", "shN_labels.webp"];
        let bands = splats.degree();
        meta["shN"] = match version {
            1 => json!({"mins": codebook[0], "maxs": codebook[255], "files": names}),
            _ => json!({"count": splats.len(), "bands": bands, "codebook": codebook, "files": names}),
        };
        // A centroid for each Gaussian, in reverse order.
        let last = splats.len() - 1;
        let rows = splats.len().div_ceil(64);
        let mut centroids = vec![[0, 0, 0, 255]; rows * 64 * rest];
        for index in 0..splats.len() {
            for (k, coefficient) in splats.coefficients(last - index)[1..].iter().enumerate() {
                let [r, g, b] = coefficient.to_array().map(&code);
                centroids[index / 64 * 64 * rest + index % 64 * rest + k] = [r, g, b, 255];
            }
        }
        let labels: Vec<[u8; 4]> = (0..splats.len())
            .map(|index| [((last - index) & 255) as u8, ((last - index) >> 8) as u8, 0, 255])
            .collect();
        files.push((names[0].into(), webp(64 * rest as u32, &centroids)));
        files.push((names[1].into(), webp(WIDTH, &labels)));
    }
    files.insert(0, ("meta.json".into(), meta.to_string().into_bytes()));
    files
}

pub fn sog_bundle(splats: &Splats, version: u32) -> Vec<u8> {
    zip(&sog(splats, version))
}

pub fn zip(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        archive.start_file(name, FileOptions::default().compression_method(zip::CompressionMethod::Stored)).unwrap();
        archive.write_all(content).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// How the numbers of a glTF file are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GltfFormat {
    Floats,
    /// Rotations, scales and opacities as normalized integers, with a stride.
    Integers,
    /// An SPZ file inside.
    Spz,
}

/// A glTF document of Gaussians that are already turned to its axes, with its nodes, and its buffer.
pub fn gltf(splats: &Splats, format: GltfFormat, nodes: Value) -> (Value, Vec<u8>) {
    let (mut buffer, mut views, mut accessors) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    let mut attributes = serde_json::Map::new();
    let gaussians = splats.gaussians();
    let name = |name: &str| format!("KHR_gaussian_splatting:{name}");
    let mut add = |name: String, kind: &str, component: u32, normalized: bool, stride: usize, rows: Vec<Vec<u8>>| {
        while !buffer.len().is_multiple_of(4) {
            buffer.push(0);
        }
        let start = buffer.len();
        for row in &rows {
            buffer.extend(row);
            buffer.resize(buffer.len() + stride - row.len(), 0xee);
        }
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": buffer.len() - start, "byteStride": stride}));
        accessors.push(json!({"bufferView": views.len() - 1, "componentType": component, "normalized": normalized,
            "count": rows.len(), "type": kind}));
        attributes.insert(name, json!(accessors.len() - 1));
    };
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    if format == GltfFormat::Spz {
        buffer = spz(splats, 3, None);
        views.push(json!({"buffer": 0, "byteLength": buffer.len()}));
    } else {
        add(
            "POSITION".into(),
            "VEC3",
            5126,
            false,
            12,
            gaussians.iter().map(|g| floats(&g.position.to_array())).collect(),
        );
        if format == GltfFormat::Floats {
            add(
                name("ROTATION"),
                "VEC4",
                5126,
                false,
                16,
                gaussians.iter().map(|g| floats(&g.rotation.to_array())).collect(),
            );
            add(
                name("SCALE"),
                "VEC3",
                5126,
                false,
                12,
                gaussians.iter().map(|g| floats(&g.scale.to_array())).collect(),
            );
            add(name("OPACITY"), "SCALAR", 5126, false, 4, gaussians.iter().map(|g| floats(&[g.opacity])).collect());
        } else {
            let shorts = |values: &[f32]| {
                values.iter().flat_map(|value| ((value * 32767.0).round() as i16).to_le_bytes()).collect::<Vec<u8>>()
            };
            let words = |values: &[f32]| {
                values.iter().flat_map(|value| ((value * 65535.0).round() as u16).to_le_bytes()).collect::<Vec<u8>>()
            };
            add(
                name("ROTATION"),
                "VEC4",
                5122,
                true,
                8,
                gaussians.iter().map(|g| shorts(&g.rotation.to_array())).collect(),
            );
            add(name("SCALE"), "VEC3", 5123, true, 8, gaussians.iter().map(|g| words(&g.scale.to_array())).collect());
            add(
                name("OPACITY"),
                "SCALAR",
                5121,
                true,
                4,
                gaussians.iter().map(|g| vec![byte(255.0 * g.opacity)]).collect(),
            );
        }
        for degree in 0..=splats.degree() {
            for index in 0..2 * degree + 1 {
                let at = (degree * degree + index) as usize;
                let rows =
                    (0..splats.len()).map(|gaussian| floats(&splats.coefficients(gaussian)[at].to_array())).collect();
                add(name(&format!("SH_DEGREE_{degree}_COEF_{index}")), "VEC3", 5126, false, 12, rows);
            }
        }
    }
    let mut extension = json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
    if format == GltfFormat::Spz {
        extension["extensions"] = json!({"KHR_gaussian_splatting_compression_spz_2": {"bufferView": 0}});
    }
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": attributes, "mode": 0, "extensions": {"KHR_gaussian_splatting": extension}}]}],
        "buffers": [{"byteLength": buffer.len()}], "bufferViews": views, "accessors": accessors,
    });
    (document, buffer)
}

pub fn glb(document: &Value, buffer: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    bytes
        .extend([2, (28 + json.len() + buffer.len()) as u32, json.len() as u32].into_iter().flat_map(u32::to_le_bytes));
    bytes.extend(b"JSON");
    bytes.extend(json);
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}
