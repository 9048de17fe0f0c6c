//! Smooths the borders between labels inside props, and draws [ink](crate::Ink). This is not part of the method.

use super::labels::{DEPTH, labeled, lit, space, with_lights};
use crate::render::{
    frame::{CachedResult, Clear, FirstGroup, Input, Output, Pass, Place, Program, RaySet, Slot},
    plan::{Feature, Plan},
};

pub(super) const FINISH: &str = "plenoctree_finish";

/// Draws borders and lines over what the label pass shows.
pub(super) fn finish(plan: &Plan) -> Option<Pass> {
    let program = Program::new("finish")
        .define_all(space(plan.target.space))
        .define_if(plan.has_ink, "INK")
        .define_all(lit(plan));
    let from = labeled(plan);
    let to = if from == Slot::Shown { Slot::Interim } else { Slot::Shown };
    let mut reads = [from, Slot::Labels, Slot::Even].map(Input::Texture).to_vec();
    reads.push(Input::Scene);
    reads.extend(plan.has_ink.then_some(Input::Texture(Slot::Depth(RaySet::Pixels))));
    plan.finishes().then(|| Pass {
        feature: Feature::Finish,
        // Lines of ink end where something else is in front of a prop.
        group: FirstGroup::with_depth_if(plan.has_ink, plan.samples),
        reads: with_lights(plan, reads),
        writes: vec![Some(Output::Texture(to))],
        depth: Some(DEPTH),
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(FINISH, Place::Posterize, Some(CachedResult::Labels), program.where_props_are())
    })
}
