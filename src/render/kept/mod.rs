//! What views keep from frame to frame, so that nothing is drawn twice.
//!
//! The layer of a view is kept as long as nothing changes that [`LayerKey`] lists, nor the depth of the scene. The
//! filtered composite is kept as long as, in addition, nothing changes that [`CompositeKey`] lists, nor the colors of the
//! scene. Labels are kept as long as, in addition, nothing changes that [`LabelsKey`] lists. Only the present pass and those
//! that write depth draw in every frame.
//!
//! Bevy draws the scene anew in every frame. Where a key has not changed, a pass compares the scene with a copy of it and
//! sets a flag if they differ. Without this flag, the vertex shaders of all passes up to the one that is kept draw
//! nothing. Views whose keys change in every frame, because the camera moves, compare and copy nothing.

mod clear;
mod compare;
mod copy;
mod key;
mod prepare;

pub(super) use clear::{ClearPipelines, Cleared};
pub(super) use compare::{COMPARE_COLORS_SPAN, COMPARE_DEPTHS_SPAN};
pub(super) use prepare::{KeptView, StaleUniform};

use bevy::{
    core_pipeline::schedule::Core3d,
    prelude::*,
    render::{Render, RenderApp, RenderStartup},
    shader::ShaderDefVal,
};

use super::{
    PosterizeSteps, VolumeSteps,
    extract::VisibleProps,
    view::{BindViews, InitViews},
};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

/// What a view keeps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum KeptPart {
    /// The layer, and all that it is made of.
    Layer,
    /// The composite, before and after the filter.
    Composite,
    /// What the label pass and the blend pass show.
    Labels,
}

impl KeptPart {
    /// Returns the definition that makes `fullscreen.wgsl` draw nothing as long as it is kept.
    pub fn definition(self) -> ShaderDefVal {
        match self {
            Self::Layer => "KEPT_LAYER".into(),
            Self::Composite => "KEPT_COMPOSITE".into(),
            Self::Labels => "KEPT_LABELS".into(),
        }
    }
}

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
