//! glTF with `KHR_gaussian_splatting`, and its compression by SPZ.
//!
//! Crates for glTF reject attributes with names that meshes do not have. Only a small part of the format matters here,
//! so it is read directly.

mod data;
mod document;

use glam::{DAffine3, DVec3, Quat, Vec3};
use serde_json::Value;

use self::{
    data::{File, Floats, read_buffers},
    document::{Document, Primitive},
};
use super::{
    shared::{Beside, check_count},
    spz,
};
use crate::{
    file::{Bytes, Fault},
    splat::{
        harmonics::functions,
        splats::{Gaussian, MOST_DEGREE, Splats},
    },
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
/// Maximum number of levels of nodes.
const MAX_LEVELS: usize = 128;

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
    if let Some(name) = document.extensions_required.iter().find(|name| name.contains("meshopt_compression")) {
        return Err(Fault::found("extensionsRequired", name.as_str(), "buffers that are not compressed"));
    }
    let buffers = read_buffers(&document, binary, &mut size, beside)?;
    let file = File { document: &document, buffers: buffers.iter().map(|buffer| &buffer[..]).collect(), size };
    let mut splats = Splats::default();
    // glTF's y is up and its x points left, as seen along z. In `.ply` files, y is down and x points right.
    let turn = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0));
    let mut found = false;
    for (mesh, transform) in file.instances()? {
        for (index, primitive) in document.meshes[mesh].primitives.iter().enumerate() {
            if let Some(part) = file.primitive(primitive, &format!("meshes[{mesh}].primitives[{index}]"))? {
                found = true;
                // Each of them takes time, also if it is damaged.
                let all = splats.len() + splats.dropped() + part.len() + part.dropped();
                check_count("nodes", all as u64, size)?;
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

        // In drafts of the extension, scales were logarithms, nearly all of which are negative.
        let negative = (0..count).filter(|index| scales.get::<3>(*index).iter().any(|scale| *scale < 0.0)).count();
        let is_draft = 2 * negative > count;
        let mut splats = Splats::new(degree);
        splats.reserve(count);
        let mut coefficients = [Vec3::ZERO; 16];
        for index in 0..count {
            let gaussian = Gaussian {
                position: Vec3::from_array(positions.get(index)),
                scale: Vec3::from_array(if is_draft { scales.get(index).map(f32::exp) } else { scales.get(index) }),
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
}
