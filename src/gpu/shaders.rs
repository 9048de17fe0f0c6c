//! The crate's shaders, embedded in the binary.

use bevy::{
    prelude::*,
    shader::{Shader, ShaderDefVal},
};
use plenoctree::{Activation, Basis};

use super::{constants, payload::Layout, upload::FieldShape};

/// Handles to the shaders, in the render world. Includes shaders that are only imported by others, to keep them loaded.
#[derive(Resource, Clone)]
pub(crate) struct Shaders {
    pub boxes: Handle<Shader>,
    pub clear: Handle<Shader>,
    pub compare: Handle<Shader>,
    pub solid: Handle<Shader>,
    pub volume: Handle<Shader>,
    pub check: Handle<Shader>,
    pub fill: Handle<Shader>,
    pub batches: Handle<Shader>,
    pub outline: Handle<Shader>,
    pub coverage: Handle<Shader>,
    pub blend: Handle<Shader>,
    pub patch: Handle<Shader>,
    pub fullscreen: Handle<Shader>,
    pub composite: Handle<Shader>,
    pub filter: Handle<Shader>,
    pub label: Handle<Shader>,
    pub prepass: Handle<Shader>,
    #[cfg(feature = "shadows")]
    pub shadow: Handle<Shader>,
    #[cfg(feature = "shadows")]
    pub shadow_tile: Handle<Shader>,
    #[cfg(feature = "shadows")]
    pub lighting: Handle<Shader>,
    pub present: Handle<Shader>,
    pub depth: Handle<Shader>,
    pub transparent: Handle<Shader>,
    pub sampling: Handle<Shader>,
    _imported: [Handle<Shader>; 13],
}

impl Shaders {
    /// Adds all shaders to the app. They are available immediately, without the asset server.
    pub fn add_to(app: &mut App) -> Self {
        let mut assets = app.world_mut().resource_mut::<Assets<Shader>>();
        macro_rules! shader {
            ($name:literal) => {
                assets.add(Shader::from_wgsl(
                    include_str!(concat!("../../shaders/", $name)),
                    concat!("bevy_plenoctree/shaders/", $name),
                ))
            };
        }
        Self {
            boxes: shader!("box.wgsl"),
            clear: shader!("clear.wgsl"),
            compare: shader!("compare.wgsl"),
            solid: shader!("solid.wgsl"),
            volume: shader!("volume.wgsl"),
            check: shader!("check.wgsl"),
            fill: shader!("fill.wgsl"),
            batches: shader!("batches.wgsl"),
            outline: shader!("outline.wgsl"),
            coverage: shader!("coverage.wgsl"),
            blend: shader!("blend.wgsl"),
            patch: shader!("patch.wgsl"),
            fullscreen: shader!("fullscreen.wgsl"),
            composite: shader!("composite.wgsl"),
            filter: shader!("filter.wgsl"),
            label: shader!("label.wgsl"),
            prepass: shader!("prepass.wgsl"),
            #[cfg(feature = "shadows")]
            shadow: shader!("shadow.wgsl"),
            #[cfg(feature = "shadows")]
            shadow_tile: shader!("shadow_tile.wgsl"),
            #[cfg(feature = "shadows")]
            lighting: shader!("lighting.wgsl"),
            present: shader!("present.wgsl"),
            depth: shader!("depth.wgsl"),
            transparent: shader!("transparent.wgsl"),
            sampling: shader!("sampling.wgsl"),
            _imported: [
                shader!("batch.wgsl"),
                shader!("color.wgsl"),
                shader!("edge.wgsl"),
                shader!("filter_texel.wgsl"),
                shader!("labels.wgsl"),
                shader!("view.wgsl"),
                shader!("scene.wgsl"),
                shader!("prop_ray.wgsl"),
                shader!("shade.wgsl"),
                shader!("target.wgsl"),
                shader!("octree.wgsl"),
                shader!("radiance.wgsl"),
                assets.add(Shader::from_wgsl(constants::wgsl(), "bevy_plenoctree/shaders/constants.wgsl")),
            ],
        }
    }
}

/// Returns the shader definitions for `radiance.wgsl`, besides those for `octree.wgsl`.
pub(crate) fn field_definitions(shape: FieldShape) -> Vec<ShaderDefVal> {
    let FieldShape { payload, activation, .. } = shape;
    let functions = payload.basis.functions();
    let used = match payload.layout {
        Layout::Halves => functions.div_ceil(2),
        Layout::Bytes => (functions - 1).div_ceil(4),
        // Texels.
        Layout::Codebook => (functions - 1).div_ceil(8),
    };
    let number = |name: &str, value: usize| ShaderDefVal::UInt(name.into(), value as u32);
    let mut definitions =
        vec![number("TEXELS", payload.texels()), number("WORDS", payload.words_per_channel()), number("USED", used)];
    let mut define = |name: &str, holds: bool| {
        if holds {
            definitions.push(name.into());
        }
    };
    define("COMPACT", payload.layout == Layout::Bytes);
    define("CODEBOOK", payload.has_codebook());
    define("RGBA", payload.basis == Basis::Rgba);
    for (degree, name) in ["DEGREE_1", "DEGREE_2", "DEGREE_3", "DEGREE_4"].into_iter().enumerate() {
        define(name, functions > (degree + 1) * (degree + 1));
    }
    define("SIGMOID", activation == Activation::Sigmoid);
    define("SHIFTED_RELU", activation == Activation::ShiftedRelu);
    definitions
}
