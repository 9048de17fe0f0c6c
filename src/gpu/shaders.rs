//! The crate's shaders, embedded in the binary.

use bevy::{
    platform::collections::HashMap,
    prelude::*,
    shader::{Shader, ShaderDefVal},
};
use plenoctree::{Activation, Basis};

use super::{constants, layout::FieldShape};

/// Handles to the shaders, in the render world, by the names of their files. Includes shaders that are only imported by
/// others, to keep them loaded.
#[derive(Resource, Clone, Default)]
pub(crate) struct Shaders(HashMap<&'static str, Handle<Shader>>);

/// Lists shaders: their names, paths and sources.
macro_rules! sources {
    ($($name:literal),* $(,)?) => {
        [$((
            $name,
            concat!("bevy_plenoctree/shaders/", $name, ".wgsl"),
            include_str!(concat!("../../shaders/", $name, ".wgsl")),
        )),*]
    };
}

impl Shaders {
    /// Adds all shaders to the app. They are available immediately, without the asset server.
    pub fn add_to(app: &mut App) -> Self {
        let mut assets = app.world_mut().resource_mut::<Assets<Shader>>();
        let constants = constants::wgsl();
        let sources = sources![
            "batch",
            "batches",
            "blend",
            "box",
            "check",
            "clear",
            "color",
            "compare",
            "composite",
            "copy",
            "coverage",
            "depth",
            "edge",
            "edge_owners",
            "fill",
            "filter",
            "filter_texel",
            "finish",
            "fog",
            "fullscreen",
            "hide_objects",
            "ink",
            "label",
            "labels",
            "lighting",
            "objects",
            "octree",
            "outline",
            "present",
            "prop_pixels",
            "prop_ray",
            "radiance",
            "recolor",
            "relief",
            "restore_depth",
            "sampling",
            "see",
            "shade",
            "shadow",
            "smooth_light",
            "solid",
            "target",
            "under_objects",
            "view",
            "volume",
        ];
        let generated = [("constants", "bevy_plenoctree/shaders/constants.wgsl", &*constants)];
        let all = sources.into_iter().chain(generated);
        Self(all.map(|(name, path, source)| (name, assets.add(Shader::from_wgsl(source.to_string(), path)))).collect())
    }

    /// Returns the shader in the file of a name.
    pub fn get(&self, name: &str) -> Handle<Shader> {
        self.0.get(name).cloned().unwrap_or_default()
    }
}

/// Returns the shader definitions for `radiance.wgsl`, besides those for `octree.wgsl`.
pub(crate) fn field_definitions(shape: FieldShape) -> Vec<ShaderDefVal> {
    let FieldShape { payload, activation, .. } = shape;
    let number = |name: &str, value: usize| ShaderDefVal::UInt(name.into(), value as u32);
    let mut definitions = vec![number("TEXELS", payload.texels()), number("WORDS", payload.words())];
    let mut define = |name: &str, holds: bool| {
        if holds {
            definitions.push(name.into());
        }
    };
    define("RGBA", payload.basis == Basis::Rgba);
    for (degree, name) in ["DEGREE_1", "DEGREE_2", "DEGREE_3", "DEGREE_4"].into_iter().enumerate() {
        define(name, payload.basis.functions() > (degree + 1) * (degree + 1));
    }
    define("SIGMOID", activation == Activation::Sigmoid);
    define("SHIFTED_RELU", activation == Activation::ShiftedRelu);
    definitions
}
