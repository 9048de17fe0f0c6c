//! The prop on screen: a volume pass and a posterise pass in the `Core3d` schedule, between the opaque and the
//! transparent main pass.

mod extract;
mod posterize;
mod rays;
mod textures;
mod view;
mod volume;

pub use posterize::POSTERIZE_SPAN;
pub use volume::VOLUME_SPAN;

use bevy::{
    core_pipeline::{
        core_3d::{main_opaque_pass_3d, main_transparent_pass_3d, prepare_core_3d_depth_textures},
        schedule::{Core3d, Core3dSystems},
    },
    prelude::*,
    render::{
        ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems,
        render_resource::SpecializedRenderPipelines,
    },
};

/// Draws every [`Prop`](crate::Prop).
pub(crate) struct PicturePlugin;

impl Plugin for PicturePlugin {
    fn build(&self, app: &mut App) {
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
            return;
        };
        render_app
            .init_resource::<extract::ExtractedProps>()
            .init_gpu_resource::<SpecializedRenderPipelines<volume::VolumePipeline>>()
            .init_gpu_resource::<SpecializedRenderPipelines<posterize::LabelPipeline>>()
            .init_gpu_resource::<SpecializedRenderPipelines<posterize::CompositePipeline>>()
            .init_gpu_resource::<SpecializedRenderPipelines<posterize::DepthPipeline>>()
            .add_systems(RenderStartup, (forget_views, view::init_layouts, (volume::init, posterize::init)).chain())
            .add_systems(ExtractSchedule, extract::extract_props)
            .add_systems(
                Render,
                (
                    (
                        view::read_depth.before(prepare_core_3d_depth_textures),
                        textures::prepare_textures,
                        view::prepare_views.after(prepare_core_3d_depth_textures),
                    )
                        .in_set(RenderSystems::PrepareResources),
                    (volume::prepare_pipelines, posterize::prepare_pipelines)
                        .after(view::prepare_views)
                        .in_set(RenderSystems::PrepareResources),
                    (volume::prepare_bind_groups, posterize::prepare_bind_groups)
                        .in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            .add_systems(
                Core3d,
                (volume::volume_pass, posterize::posterize_pass)
                    .chain()
                    .after(main_opaque_pass_3d)
                    .before(main_transparent_pass_3d)
                    .in_set(Core3dSystems::MainPass),
            );
    }
}

/// Drops what views hold of a device that was lost; the next extraction begins anew.
fn forget_views(mut commands: Commands, views: Query<Entity, With<view::ViewProps>>) {
    for view in &views {
        commands.entity(view).remove::<(
            view::ViewProps,
            extract::VisibleProps,
            textures::PropTextures,
            volume::VolumeBindGroup,
            volume::VolumePipelines,
            posterize::PosterizeBindGroups,
            posterize::PosterizePipelines,
        )>();
    }
}
