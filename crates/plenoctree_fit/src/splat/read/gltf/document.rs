//! The parts of a glTF document that matter here.

use std::collections::HashMap;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde_json::Value;

use crate::file::Fault;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Document {
    #[serde(default)]
    pub extensions_required: Vec<String>,
    #[serde(default)]
    pub scene: usize,
    #[serde(default)]
    pub scenes: Vec<Scene>,
    #[serde(default)]
    pub nodes: Vec<Node>,
    #[serde(default)]
    pub meshes: Vec<Mesh>,
    #[serde(default)]
    pub accessors: Vec<Accessor>,
    #[serde(default)]
    pub buffer_views: Vec<View>,
    #[serde(default)]
    pub buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
pub struct Scene {
    #[serde(default)]
    pub nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub struct Node {
    #[serde(default)]
    pub children: Vec<usize>,
    pub mesh: Option<usize>,
    pub matrix: Option<[f64; 16]>,
    pub translation: Option<[f64; 3]>,
    pub rotation: Option<[f64; 4]>,
    pub scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
pub struct Mesh {
    pub primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
pub struct Primitive {
    #[serde(default)]
    pub attributes: HashMap<String, usize>,
    #[serde(default)]
    pub extensions: HashMap<String, Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: u32,
    #[serde(default)]
    pub normalized: bool,
    pub count: u64,
    pub r#type: String,
    pub sparse: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct View {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Buffer {
    pub uri: Option<String>,
    pub byte_length: u64,
}

impl Node {
    pub fn transform(&self, index: usize) -> Result<DAffine3, Fault> {
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
