//! The shadow pass: draws props into the shadow maps of Bevy's lights. Requires the feature `shadows`.
//!
//! It runs after the passes in which Bevy draws meshes into the same maps: once per camera for directional lights, and
//! once per frame for point and spot lights. The ray of each texel is marched through densities to the point where the
//! prop is solid. Maps without props cost nothing.
//!
//! Rays are not marched twice: what a caster at rest adds to a map is *cached* in a tile and copied into the map in
//! every frame, until anything that [`CasterKey`](cached::CasterKey) lists changes. A camera that moves changes
//! nothing, because Bevy moves the maps of directional lights by whole texels. Tiles take no more memory than the maps.
//! Casters whose tiles do not fit are marched in every frame, as are casters that move.

mod cached;
mod casters;
mod maps;
mod texels;

pub use maps::SHADOW_SPAN;

use bevy::{
    camera::visibility::VisibilitySystems,
    core_pipeline::schedule::{Core3d, Core3dSystems},
    light::SimulationLightSystems,
    pbr::{LATE_SHADOW_PASS, ShadowView, per_view_shadow_pass, shared_shadow_pass},
    prelude::*,
    render::{ExtractSchedule, Render, RenderApp, RenderStartup},
};

use super::prepare::plan_views;
use crate::sets::PlenOctreeRenderSystems;

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<ShadowView, maps::MapProps>();
    render_app
        .init_resource::<casters::Casters>()
        .add_systems(ExtractSchedule, casters::extract_casters)
        .add_systems(RenderStartup, maps::forget_maps)
        .add_systems(
            Render,
            (
                casters::choose_levels.in_set(PlenOctreeRenderSystems::ChooseLevels),
                maps::prepare_maps.in_set(PlenOctreeRenderSystems::PlanViews).after(plan_views),
            ),
        )
        .add_systems(
            Core3d,
            maps::draw_maps
                .after(per_view_shadow_pass::<LATE_SHADOW_PASS>)
                .after(shared_shadow_pass::<LATE_SHADOW_PASS>)
                .before(Core3dSystems::MainPass),
        );
    app.add_systems(
        PostUpdate,
        casters::show_casters
            .in_set(SimulationLightSystems::CheckLightVisibility)
            .after(VisibilitySystems::CalculateBounds)
            .after(TransformSystems::Propagate)
            .after(SimulationLightSystems::UpdateLightFrusta)
            .after(VisibilitySystems::CheckVisibility)
            .before(VisibilitySystems::MarkNewlyHiddenEntitiesInvisible),
    );
}
