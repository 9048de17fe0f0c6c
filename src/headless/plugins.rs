//! What an app needs to render without a window.

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

/// The plugins of an app that renders into pictures: no window, pipelines ready when they are first used, rendering on
/// the thread that updates the app.
///
/// They are only what props and unlit pictures need: tasks, time, transforms, diagnostics, input, windows, assets, the
/// renderer, images, meshes, cameras and the core pipelines. For lit meshes add Bevy's `LightPlugin` and `PbrPlugin`, for
/// bloom and its like `PostProcessPlugin`, for messages `LogPlugin`.
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

/// A renderer whose pipelines are ready when they are first used.
pub(super) fn render_plugin(settings: WgpuSettings) -> RenderPlugin {
    RenderPlugin { render_creation: settings.into(), synchronous_pipeline_compilation: true, ..default() }
}

/// Whether there is an adapter at all, on a backend that Bevy would use: its renderer panics where there is none.
pub(super) fn check_adapter() -> Result<(), String> {
    let backends = Backends::from_env().unwrap_or(Backends::all());
    let instance = Instance::new(InstanceDescriptor { backends, ..InstanceDescriptor::new_without_display_handle() });
    let request = instance.request_adapter(&RequestAdapterOptions::default());
    block_on(request).map(drop).map_err(|error| error.to_string())
}
