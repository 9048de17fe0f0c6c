//! The prop on screen: a volume pass and a posterize pass in the `Core3d` schedule.
//!
//! The first comes between the opaque and the transparent main pass, and so does the second, or last of all
//! post-processing: [`PropStage`] says which.

mod extract;
mod last;
mod pipelines;
mod posterize;
mod rays;
mod textures;
mod uniforms;
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

use crate::view::PropStage;

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
            .init_gpu_resource::<SpecializedRenderPipelines<pipelines::LabelPipeline>>()
            .init_gpu_resource::<SpecializedRenderPipelines<pipelines::CompositePipeline>>()
            .init_gpu_resource::<SpecializedRenderPipelines<pipelines::DepthPipeline>>()
            .add_systems(RenderStartup, (forget_views, view::init_layouts, (volume::init, pipelines::init)).chain())
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
                    (volume::prepare_pipelines, pipelines::prepare_pipelines)
                        .after(view::prepare_views)
                        .in_set(RenderSystems::PrepareResources),
                    (volume::prepare_bind_groups, posterize::prepare_bind_groups)
                        .in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            .add_systems(
                Core3d,
                (
                    (volume::volume_pass, posterize::posterize_pass.with_input(PropStage::Scene))
                        .chain()
                        .after(main_opaque_pass_3d)
                        .before(main_transparent_pass_3d)
                        .in_set(Core3dSystems::MainPass),
                    posterize::posterize_pass.with_input(PropStage::Display).in_set(DisplayPass),
                ),
            )
            // Tonemapping, and effects of other plugins too, swap the view's textures: what is not ordered with them may
            // draw into the wrong one.
            .edit_schedule(Core3d, |schedule| {
                last::order_last(schedule, DisplayPass, Core3dSystems::PostProcess);
            });
    }
}

/// The posterize pass at [`PropStage::Display`].
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
struct DisplayPass;

/// Drops what views hold of a device that was lost; the next extraction begins anew.
fn forget_views(mut commands: Commands, views: Query<Entity, With<view::ViewProps>>) {
    for view in &views {
        commands.entity(view).remove::<(
            view::ViewProps,
            extract::VisibleProps,
            textures::PropTextures,
            volume::VolumeBindGroups,
            volume::VolumePipelines,
            posterize::PosterizeBindGroups,
            pipelines::PosterizePipelines,
        )>();
    }
}
