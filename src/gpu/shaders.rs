//! The crate's shaders, compiled into the binary.

use bevy::{prelude::*, shader::Shader};

/// Handles of the shaders, in the render world. Those that only others import are kept too, to keep them loaded.
#[derive(Resource, Clone)]
pub(crate) struct Shaders {
    pub volume: Handle<Shader>,
    pub fullscreen: Handle<Shader>,
    pub composite: Handle<Shader>,
    pub bilateral: Handle<Shader>,
    pub posterize: Handle<Shader>,
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
            _imported: [shader!("color.wgsl"), shader!("view.wgsl"), shader!("octree.wgsl"), shader!("radiance.wgsl")],
        }
    }
}
