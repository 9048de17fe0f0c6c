//! The lighting pass: finds how much of the scene's light is blocked before it reaches the solid parts of props with a
//! `PropLighting`. The label pass reads its result.

#[cfg(feature = "shadows")]
mod pass;
#[cfg(feature = "shadows")]
mod pipeline;
#[cfg(feature = "shadows")]
mod prepare;
mod read;

#[cfg(feature = "shadows")]
pub use pass::LIGHTING_SPAN;
pub(super) use read::{LightingLayout, ReadLighting};

use bevy::{prelude::*, render::RenderApp};

use super::extract::VisibleProps;

pub(super) fn plugin(app: &mut App) {
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.world_mut().register_required_components::<VisibleProps, ReadLighting>();
        render_app.init_resource::<LightingLayout>();
        #[cfg(feature = "shadows")]
        add_pass(render_app);
    }
}

#[cfg(feature = "shadows")]
fn add_pass(render_app: &mut SubApp) {
    use bevy::{
        core_pipeline::schedule::Core3d,
        render::{
            ExtractSchedule, GpuResourceAppExt, Render, RenderStartup, render_resource::SpecializedRenderPipelines,
        },
    };

    use super::{
        extract::extract_props,
        steps::{PassesAt, PassesInScene, PrepareTextures},
    };
    use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

    render_app.world_mut().register_required_components::<VisibleProps, prepare::ViewLighting>();
    render_app
        .init_gpu_resource::<SpecializedRenderPipelines<pipeline::LightingPipeline>>()
        .add_systems(ExtractSchedule, prepare::extract_lighting.after(extract_props))
        .add_systems(RenderStartup, pipeline::init)
        .add_systems(
            Render,
            (
                prepare::prepare_lit.in_set(PrepareTextures),
                pass::prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
                prepare::prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(
            Core3d,
            pass::lighting_pass
                .in_set(PassesInScene)
                .after(PlenOctreeRenderSystems::Refine)
                .before(PassesAt(PropStage::Scene)),
        );
}
