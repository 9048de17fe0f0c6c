//! What views keep from frame to frame, so that nothing is drawn twice.
//!
//! The layer of a view is kept until the depth of the scene changes, or anything that [`LayerKey`] lists. The filtered
//! composite is kept until the layer changes, the colors of the scene, or anything that [`CompositeKey`] lists. Labels
//! are kept until the composite changes, or anything that [`LabelsKey`] lists. Where nothing is posterized, there is no
//! composite, and labels are kept until it would change. Only the present pass and those that write depth draw in every
//! frame.
//!
//! Bevy redraws the scene in every frame. Where a key has not changed, a pass compares the scene with a copy of it and
//! sets a flag if they differ. Without this flag, the vertex shaders of all passes up to the one that is kept draw
//! nothing. Views whose keys change in every frame, because the camera moves, compare and copy nothing.

mod clear;
mod compare;
mod copy;
mod key;
mod part;
mod prepare;
mod view;

pub(super) use clear::{ClearPipelines, Cleared};
pub(super) use compare::{COMPARE_COLORS_SPAN, COMPARE_DEPTHS_SPAN};
pub(super) use part::KeptPart;
pub(super) use view::{KeptView, StaleUniform};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{Render, RenderApp, RenderStartup},
};

use super::{
    extract::VisibleProps,
    steps::{PosterizeSteps, VolumeSteps},
    view::{BindViews, InitViews},
};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, KeptView>();
    render_app
        .add_systems(RenderStartup, (clear::init, compare::init).after(InitViews))
        .add_systems(
            Render,
            (
                prepare::prepare.before(BindViews).in_set(PlenOctreeRenderSystems::PrepareBindGroups),
                compare::prepare_bind_groups.after(prepare::prepare).in_set(PlenOctreeRenderSystems::PrepareBindGroups),
            ),
        )
        .add_systems(Core3d, compare::compare_depths.in_set(VolumeSteps::Compare));
    for stage in [PropStage::Scene, PropStage::Display] {
        let compare = compare::compare_colors.with_input(stage);
        render_app.add_systems(Core3d, compare.in_set(PosterizeSteps::Compare(stage)));
    }
}
