//! The plugins of an app without a window.

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
/// It contains only what props and unlit meshes need: tasks, time, transforms, diagnostics, input, windows, assets, the
/// renderer, images, meshes, cameras and the core pipelines. Add Bevy's `LightPlugin` and `PbrPlugin` for lit meshes,
/// `PostProcessPlugin` for bloom and similar effects, and `LogPlugin` for log messages.
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

/// Returns a [`RenderPlugin`] that compiles pipelines synchronously, so that they are ready when they are first used.
pub(super) fn render_plugin(settings: WgpuSettings) -> RenderPlugin {
    RenderPlugin { render_creation: settings.into(), synchronous_pipeline_compilation: true, ..default() }
}

/// Returns an error if there is no graphics adapter on any backend that Bevy uses. Bevy's renderer would panic.
pub(super) fn check_adapter() -> Result<(), String> {
    let backends = Backends::from_env().unwrap_or(Backends::all());
    let instance = Instance::new(InstanceDescriptor { backends, ..InstanceDescriptor::new_without_display_handle() });
    let request = instance.request_adapter(&RequestAdapterOptions::default());
    block_on(request).map(drop).map_err(|error| error.to_string())
}
