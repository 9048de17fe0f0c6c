//! The crate's shaders, compiled into the binary.

use bevy::{
    prelude::*,
    shader::{Shader, ShaderDefVal},
};

use super::field::words_per_channel;
use crate::field::{Activation, Basis};

/// Handles of the shaders, in the render world. Those that only others import are kept too, to keep them loaded.
#[derive(Resource, Clone)]
pub(crate) struct Shaders {
    pub volume: Handle<Shader>,
    pub fullscreen: Handle<Shader>,
    pub composite: Handle<Shader>,
    pub bilateral: Handle<Shader>,
    pub posterize: Handle<Shader>,
    pub depth: Handle<Shader>,
    pub sampling: Handle<Shader>,
    _imported: [Handle<Shader>; 4],
}

impl Shaders {
    /// Adds all shaders to the app. They are there at once: nothing waits for an asset server.
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
            volume: shader!("volume.wgsl"),
            fullscreen: shader!("fullscreen.wgsl"),
            composite: shader!("composite.wgsl"),
            bilateral: shader!("bilateral.wgsl"),
            posterize: shader!("posterize.wgsl"),
            depth: shader!("depth.wgsl"),
            sampling: shader!("sampling.wgsl"),
            _imported: [shader!("color.wgsl"), shader!("view.wgsl"), shader!("octree.wgsl"), shader!("radiance.wgsl")],
        }
    }
}

/// The definitions that `radiance.wgsl` needs, for coefficients in so many parts.
pub(crate) fn radiance_definitions(basis: Basis, activation: Activation, parts: usize) -> Vec<ShaderDefVal> {
    let mut definitions = vec![ShaderDefVal::UInt("WORDS".into(), words_per_channel(basis) as u32)];
    if basis == Basis::Rgba {
        definitions.push("RGBA".into());
    }
    for (degree, name) in ["DEGREE_1", "DEGREE_2", "DEGREE_3", "DEGREE_4"].into_iter().enumerate() {
        if basis.functions() > (degree + 1) * (degree + 1) {
            definitions.push(name.into());
        }
    }
    for (name, least) in [("PARTS_2", 2), ("PARTS_3", 3), ("PARTS_4", 4)] {
        if parts >= least {
            definitions.push(name.into());
        }
    }
    match activation {
        Activation::Sigmoid => definitions.push("SIGMOID".into()),
        Activation::ShiftedRelu => definitions.push("SHIFTED_RELU".into()),
        Activation::Identity => {}
    }
    definitions
}
