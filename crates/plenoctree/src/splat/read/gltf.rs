//! glTF with `KHR_gaussian_splatting`, and its compression by SPZ.
//!
//! The names of these attributes are not those of meshes, which crates for glTF reject. So little of the format matters
//! here that it is read directly.

use std::collections::HashMap;

use glam::{DAffine3, DMat4, DQuat, DVec3, Quat, Vec3};
use serde::Deserialize;
use serde_json::Value;

use super::{
    Beside, Fault, Splats,
    bytes::{Bytes, Number},
    check_count, spz,
};
use crate::splat::{
    harmonics::functions,
    splats::{Gaussian, MOST_DEGREE},
};

const EXTENSION: &str = "KHR_gaussian_splatting";
/// Extensions of the extension, or of the primitive in drafts, that hold an SPZ file.
const SPZ: [&str; 3] = [
    "KHR_gaussian_splatting_compression_spz_2",
    "KHR_gaussian_splatting_compression_spz",
    "KHR_spz_gaussian_splats_compression",
];
/// The type of a JSON chunk, and of a binary one.
const CHUNKS: [[u8; 4]; 2] = [*b"JSON", *b"BIN\0"];
/// Most levels of nodes.
const MAX_LEVELS: usize = 128;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    scene: usize,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<View>,
    #[serde(default)]
    buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<usize>,
    mesh: Option<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    #[serde(default)]
    attributes: HashMap<String, usize>,
    #[serde(default)]
    extensions: HashMap<String, Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: u64,
    r#type: String,
    sparse: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Buffer {
    uri: Option<String>,
    byte_length: u64,
}

/// Reads a `.glb` file.
pub fn read_binary(bytes: &[u8], beside: Beside) -> Result<Splats, Fault> {
    let mut rest = Bytes::new(bytes);
    let _magic: [u8; 4] = rest.array("header")?;
    let version = rest.u32("header")?;
    if version != 2 {
        return Err(Fault::found("version", version.to_string(), "2"));
    }
    let _length = rest.u32("header")?;
    let mut chunks: [Option<&[u8]>; 2] = [None; 2];
    while rest.len() >= 8 {
        let size = rest.u32("chunk")?;
        let kind: [u8; 4] = rest.array("chunk")?;
        let content = rest.take(size.into(), "chunk")?;
        if let Some(index) = CHUNKS.iter().position(|known| *known == kind) {
            chunks[index].get_or_insert(content);
        }
    }
    let [Some(json), binary] = chunks else {
        return Err(Fault::found("chunks", "no JSON", "a JSON chunk"));
    };
    read(json, binary, bytes.len() as u64, beside)
}

/// Reads a `.gltf` file.
pub fn read_text(bytes: &[u8], beside: Beside) -> Result<Splats, Fault> {
    read(bytes, None, bytes.len() as u64, beside)
}

fn read(json: &[u8], binary: Option<&[u8]>, mut size: u64, beside: Beside) -> Result<Splats, Fault> {
    let document: Document =
        serde_json::from_slice(json).map_err(|error| Fault::found("JSON", error.to_string(), "a glTF 2.0 document"))?;
    let mut buffers = Vec::new();
    for (index, buffer) in document.buffers.iter().enumerate() {
        let what = format!("buffers[{index}]");
        let content = match (&buffer.uri, binary) {
            (None, Some(binary)) if index == 0 => std::borrow::Cow::Borrowed(binary),
            (None, _) => return Err(Fault::found(what, "no uri", "a file, data, or the binary chunk")),
            (Some(uri), _) => {
                let content = match uri.strip_prefix("data:").and_then(|data| data.split_once(";base64,")) {
                    Some((_, data)) => base64(data, &what)?,
                    None => beside(&unescaped(uri))?,
                };
                size += content.len() as u64;
                content.into()
            }
        };
        if (content.len() as u64) < buffer.byte_length {
            let expected = format!("{} bytes", buffer.byte_length);
            return Err(Fault::found(what, format!("{} bytes", content.len()), expected));
        }
        buffers.push(content);
    }
    let file = File { document: &document, buffers: buffers.iter().map(|buffer| &buffer[..]).collect(), size };
    let mut splats = Splats::default();
    // glTF's y is up and its x points left, as seen along z. In `.ply` files, y is down and x points right.
    let turn = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0));
    let mut found = false;
    for (mesh, transform) in file.instances()? {
        for (index, primitive) in document.meshes[mesh].primitives.iter().enumerate() {
            if let Some(part) = file.primitive(primitive, &format!("meshes[{mesh}].primitives[{index}]"))? {
                found = true;
                check_count("nodes", (splats.len() + part.len()) as u64, size)?;
                splats.append(&part.transformed(turn * transform));
            }
        }
    }
    if !found {
        let expected = format!("at least one in the scene, with {EXTENSION}");
        return Err(Fault::found("primitives", "none with Gaussians", expected));
    }
    Ok(splats)
}

struct File<'a> {
    document: &'a Document,
    buffers: Vec<&'a [u8]>,
    size: u64,
}

impl File<'_> {
    /// Returns the meshes of the scene, and where they are.
    fn instances(&self) -> Result<Vec<(usize, DAffine3)>, Fault> {
        let Document { scene, scenes, nodes, meshes, .. } = self.document;
        let roots: Vec<usize> = match scenes.get(*scene) {
            Some(scene) => scene.nodes.clone(),
            None if scenes.is_empty() => {
                let mut is_root = vec![true; nodes.len()];
                for &child in nodes.iter().flat_map(|node| &node.children).filter(|child| **child < nodes.len()) {
                    is_root[child] = false;
                }
                (0..nodes.len()).filter(|&node| is_root[node]).collect()
            }
            None => return Err(Fault::found("scene", scene.to_string(), format!("one of {}", scenes.len()))),
        };
        let mut instances = Vec::new();
        let mut visited = vec![false; nodes.len()];
        let mut stack: Vec<(usize, DAffine3, usize)> =
            roots.into_iter().map(|root| (root, DAffine3::IDENTITY, 0)).collect();
        while let Some((index, parent, level)) = stack.pop() {
            let Some(node) = nodes.get(index) else {
                return Err(Fault::found("node", index.to_string(), format!("one of {}", nodes.len())));
            };
            if std::mem::replace(&mut visited[index], true) || level > MAX_LEVELS {
                return Err(Fault::found(format!("nodes[{index}]"), "a node that is reached twice", "a tree of nodes"));
            }
            let transform = parent * node.transform(index)?;
            if let Some(mesh) = node.mesh {
                if mesh >= meshes.len() {
                    let expected = format!("one of {}", meshes.len());
                    return Err(Fault::found(format!("nodes[{index}].mesh"), mesh.to_string(), expected));
                }
                instances.push((mesh, transform));
            }
            stack.extend(node.children.iter().rev().map(|&child| (child, transform, level + 1)));
        }
        Ok(instances)
    }

    /// Returns the Gaussians of a primitive, if it has any.
    fn primitive(&self, primitive: &Primitive, what: &str) -> Result<Option<Splats>, Fault> {
        let extension = primitive.extensions.get(EXTENSION);
        let inner = extension.and_then(|extension| extension.get("extensions"));
        let packed =
            SPZ.iter().find_map(|name| inner.and_then(|inner| inner.get(name)).or(primitive.extensions.get(*name)));
        if let Some(packed) = packed {
            let view = packed.get("bufferView").and_then(Value::as_u64).unwrap_or(u64::MAX);
            let (bytes, _) = self.view(usize::try_from(view).unwrap_or(usize::MAX), what)?;
            return Ok(Some(spz::read_as_stored(bytes)?.0));
        }
        let Some(extension) = extension else { return Ok(None) };
        let expect = |key: &str, only: &str| match extension.get(key).and_then(Value::as_str) {
            Some(found) if found != only => Err(Fault::found(format!("{what}.{EXTENSION}.{key}"), found, only)),
            _ => Ok(()),
        };
        expect("kernel", "ellipse")?;
        expect("colorSpace", "srgb_rec709_display")?;

        let attribute = |name: &str, kind: &'static str| -> Result<Floats, Fault> {
            let Some(&index) = primitive.attributes.get(name) else {
                return Err(Fault::found(what, format!("no attribute {name}"), "all attributes of Gaussians"));
            };
            self.accessor(index, name, kind)
        };
        let own = |name: &str| format!("{EXTENSION}:{name}");
        let positions = attribute("POSITION", "VEC3")?;
        let count = check_count(what, positions.count, self.size)?;
        let rotations = attribute(&own("ROTATION"), "VEC4")?;
        let scales = attribute(&own("SCALE"), "VEC3")?;
        let opacities = attribute(&own("OPACITY"), "SCALAR")?;
        let harmonic = |degree: u32, index: u32| own(&format!("SH_DEGREE_{degree}_COEF_{index}"));
        let has = |degree: u32| primitive.attributes.contains_key(&harmonic(degree, 0));
        let degree = (1..=MOST_DEGREE).take_while(|degree| has(*degree)).last().unwrap_or(0);
        let harmonics: Vec<Floats> = (0..=degree)
            .flat_map(|degree| (0..2 * degree + 1).map(move |index| (degree, index)))
            .map(|(degree, index)| attribute(&harmonic(degree, index), "VEC3"))
            .collect::<Result<_, _>>()?;
        for floats in [&rotations, &scales, &opacities].into_iter().chain(&harmonics) {
            if floats.count != positions.count {
                let expected = format!("{} as there are positions", positions.count);
                return Err(Fault::found(what, format!("{} values of an attribute", floats.count), expected));
            }
        }

        let mut splats = Splats::new(degree);
        splats.reserve(count);
        let mut coefficients = [Vec3::ZERO; 16];
        for index in 0..count {
            let gaussian = Gaussian {
                position: Vec3::from_array(positions.get(index)),
                scale: Vec3::from_array(scales.get(index)),
                rotation: Quat::from_array(rotations.get(index)),
                opacity: opacities.get::<1>(index)[0],
            };
            for (coefficient, floats) in coefficients.iter_mut().zip(&harmonics) {
                *coefficient = Vec3::from_array(floats.get(index));
            }
            splats.push(gaussian, &coefficients[..functions(degree)]);
        }
        Ok(Some(splats))
    }

    fn accessor(&self, index: usize, name: &str, kind: &'static str) -> Result<Floats<'_>, Fault> {
        let Some(accessor) = self.document.accessors.get(index) else {
            let expected = format!("one of {}", self.document.accessors.len());
            return Err(Fault::found(name, format!("accessor {index}"), expected));
        };
        if accessor.r#type != kind {
            return Err(Fault::found(name, accessor.r#type.as_str(), kind));
        }
        if accessor.sparse.is_some() {
            return Err(Fault::found(name, "a sparse accessor", "one that is not sparse"));
        }
        let (number, largest) = match accessor.component_type {
            5120 => (Number::I8, 127.0),
            5121 => (Number::U8, 255.0),
            5122 => (Number::I16, 32767.0),
            5123 => (Number::U16, 65535.0),
            5126 => (Number::F32, 1.0),
            other => return Err(Fault::found(name, format!("component type {other}"), "a type of glTF 2.0")),
        };
        let parts = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let size = parts * number.size();
        let (bytes, stride) = self.view(accessor.buffer_view.unwrap_or(usize::MAX), name)?;
        let stride = stride.unwrap_or(size as u64);
        let needed = match accessor.count {
            0 => 0,
            count => (count - 1).saturating_mul(stride).saturating_add(size as u64),
        };
        let end = accessor.byte_offset.saturating_add(needed);
        if end > bytes.len() as u64 || stride < size as u64 {
            let found = format!("{} bytes with a stride of {stride}", bytes.len());
            return Err(Fault::found(name, found, format!("{end} bytes with a stride of at least {size}")));
        }
        let bytes = &bytes[accessor.byte_offset as usize..end as usize];
        let unit = if accessor.normalized { 1.0 / largest } else { 1.0 };
        Ok(Floats { bytes, number, stride: stride as usize, count: accessor.count, unit })
    }

    /// Returns the bytes of a view and their stride.
    fn view(&self, index: usize, what: &str) -> Result<(&[u8], Option<u64>), Fault> {
        let views = &self.document.buffer_views;
        let Some(view) = views.get(index) else {
            return Err(Fault::found(what, "no buffer view", format!("one of {}", views.len())));
        };
        let Some(buffer) = self.buffers.get(view.buffer) else {
            let expected = format!("one of {}", self.buffers.len());
            return Err(Fault::found(what, format!("buffer {}", view.buffer), expected));
        };
        let end = view.byte_offset.saturating_add(view.byte_length);
        if end > buffer.len() as u64 {
            return Err(Fault::found(what, format!("a buffer of {} bytes", buffer.len()), format!("{end} bytes")));
        }
        Ok((&buffer[view.byte_offset as usize..end as usize], view.byte_stride))
    }
}

/// The numbers of an attribute.
struct Floats<'a> {
    bytes: &'a [u8],
    number: Number,
    stride: usize,
    count: u64,
    /// What one is stored as, inverted.
    unit: f64,
}

impl Floats<'_> {
    fn get<const N: usize>(&self, index: usize) -> [f32; N] {
        let bytes = &self.bytes[index * self.stride..];
        std::array::from_fn(|part| (self.unit * self.number.read(&bytes[part * self.number.size()..], false)) as f32)
    }
}

impl Node {
    fn transform(&self, index: usize) -> Result<DAffine3, Fault> {
        let transform = match self.matrix {
            Some(matrix) => DAffine3::from_mat4(DMat4::from_cols_array(&matrix)),
            None => DAffine3::from_scale_rotation_translation(
                DVec3::from_array(self.scale.unwrap_or([1.0; 3])),
                DQuat::from_array(self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])).normalize(),
                DVec3::from_array(self.translation.unwrap_or([0.0; 3])),
            ),
        };
        if !transform.is_finite() || transform.matrix3.determinant() == 0.0 {
            return Err(Fault::found(
                format!("nodes[{index}]"),
                "a transform that is not invertible",
                "an invertible one",
            ));
        }
        Ok(transform)
    }
}

/// Decodes `%20` and the like.
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let code = match after {
            [high, low, ..] if *first == b'%' => {
                std::str::from_utf8(&[*high, *low]).ok().and_then(|digits| u8::from_str_radix(digits, 16).ok())
            }
            _ => None,
        };
        bytes.push(code.unwrap_or(*first));
        rest = &rest[if code.is_some() { 3 } else { 1 }..];
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn base64(text: &str, what: &str) -> Result<Vec<u8>, Fault> {
    let (mut bytes, mut bits, mut count) = (Vec::with_capacity(text.len() / 4 * 3), 0u32, 0);
    for letter in text.bytes().filter(|letter| *letter != b'=') {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return Err(Fault::found(what, format!("byte {letter:02x}"), "base64")),
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
            bits &= (1 << count) - 1;
        }
    }
    Ok(bytes)
}
