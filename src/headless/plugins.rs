//! The plugins of an app without a window.

use std::sync::OnceLock;

use bevy::{
    app::{PluginGroupBuilder, TaskPoolPlugin},
    asset::AssetPlugin,
    camera::CameraPlugin,
    core_pipeline::CorePipelinePlugin,
    diagnostic::{DiagnosticsPlugin, FrameCountPlugin},
    image::ImagePlugin,
    input::InputPlugin,
    mesh::MeshPlugin,
    prelude::*,
    render::{RenderPlugin, settings::WgpuSettings},
    tasks::block_on,
    time::TimePlugin,
    transform::TransformPlugin,
    window::{ExitCondition, WindowPlugin},
};
use wgpu::{Backends, Instance, InstanceDescriptor, RequestAdapterOptions};

/// A plugin group for apps that render to images: no window, synchronous pipeline compilation, and rendering on the
/// thread that updates the app.
///
/// It contains only the plugins that props need: tasks, time, transforms, diagnostics, input, windows, assets, the
/// renderer, images, meshes, cameras and the core pipelines. Add `LitMeshPlugins` (feature `headless-lit`) for meshes
/// with Bevy's materials, lights, shadows, gizmos, and effects such as bloom, and Bevy's `LogPlugin` for log messages.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeadlessPlugins;

impl PluginGroup for HeadlessPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(TaskPoolPlugin::default())
            .add(FrameCountPlugin)
            .add(TimePlugin)
            .add(TransformPlugin)
            .add(DiagnosticsPlugin)
            .add(InputPlugin)
            .add(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .add(AssetPlugin::default())
            .add(render_plugin(WgpuSettings::default()))
            .add(ImagePlugin::default())
            .add(MeshPlugin)
            .add(CameraPlugin)
            .add(CorePipelinePlugin)
    }
}

/// A plugin group that adds to [`HeadlessPlugins`] what meshes with Bevy's materials need: lights, shadows, materials,
/// gizmos, and effects such as bloom. Requires the feature `headless-lit`.
///
/// For glTF models, add Bevy's `GltfPlugin` first, and then `LitMeshPlugins.set(PbrPlugin::default())`.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, headless::{Headless, LitMeshPlugins}};
/// let headless = Headless::new(UVec2::new(640, 480), |app| {
///     app.add_plugins((LitMeshPlugins, PlenOctreePlugin));
/// });
/// ```
#[cfg(feature = "headless-lit")]
#[derive(Clone, Copy, Debug, Default)]
pub struct LitMeshPlugins;

#[cfg(feature = "headless-lit")]
impl PluginGroup for LitMeshPlugins {
    fn build(self) -> PluginGroupBuilder {
        PluginGroupBuilder::start::<Self>()
            .add(bevy::light::LightPlugin)
            .add(bevy::post_process::PostProcessPlugin)
            // With the materials of glTF models, it panics if there is no loader of such models.
            .add(bevy::pbr::PbrPlugin { gltf_enable_standard_materials: false, ..default() })
            .add(bevy::gizmos::GizmoPlugin)
            .add(bevy::gizmos_render::GizmoRenderPlugin)
    }
}

/// Lets the CPU find the lights that reach each part of a view. On the GPU, Bevy finds them with numbers that it reads
/// back from former frames: the first frames after a lamp was spawned may lack its light.
#[cfg(feature = "headless-lit")]
pub(super) fn light_every_frame(app: &mut App) {
    if let Some(mut settings) = app.world_mut().get_resource_mut::<bevy::light::cluster::GlobalClusterSettings>() {
        settings.gpu_clustering = None;
    }
}

/// Returns a [`RenderPlugin`] that compiles pipelines synchronously, so that they are ready when they are first used.
pub(super) fn render_plugin(settings: WgpuSettings) -> RenderPlugin {
    RenderPlugin { render_creation: settings.into(), synchronous_pipeline_compilation: true, ..default() }
}

/// Returns an error if there is no graphics adapter on any backend that Bevy uses. Bevy's renderer would panic.
pub(super) fn check_adapter() -> Result<(), String> {
    // It is kept, so that the driver stays loaded: some can be loaded only a few dozen times, and crash if an app ends while
    // another one begins.
    static INSTANCE: OnceLock<Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| {
        let backends = Backends::from_env().unwrap_or(Backends::all());
        Instance::new(InstanceDescriptor { backends, ..InstanceDescriptor::new_without_display_handle() })
    });
    let request = instance.request_adapter(&RequestAdapterOptions::default());
    block_on(request).map(drop).map_err(|error| error.to_string())
}
