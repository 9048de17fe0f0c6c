//! Smooths the borders between labels inside props (section 4 of the method, step 11), draws [ink](crate::Ink), and
//! smooths the edges of props (step 6). None of this is in the paper.

use super::labels::{lit, space, with_lights};
use crate::render::{
    frame::{CachedResult, Clear, FirstGroup, Pass, Place, Program, Slot},
    plan::{Feature, Plan},
};

pub(super) const FINISH: &str = "plenoctree_finish";

/// Draws borders and lines over what the label pass shows, and then pixels at edges.
pub(super) fn finish(plan: &Plan) -> Option<Pass> {
    // The target no longer has samples.
    let is_resolved = plan.samples > 1 && plan.hidden_samples().is_none() && !plan.posterizes_view;
    let program = |name| {
        let program = Program::new(name).define_all(space(plan.target.space)).define_all(lit(plan));
        program.define_if(plan.has_ink, "INK")
    };
    let inside = if plan.finishes() { program("finish") } else { Program::new("copy") };
    let at_edges = program("blend").define_number("SAMPLES", plan.hidden_samples()).define_if(is_resolved, "RESOLVED");
    let mut programs = vec![if plan.smooths { inside.where_mask_has_props() } else { inside.where_props_are() }];
    programs.extend(plan.smooths.then(|| at_edges.at_edges()));
    let mut inputs = vec![Slot::Interim, Slot::Even, Slot::DEPTH, Slot::Scene];
    inputs.extend(plan.finishes().then_some(Slot::Labels));
    let mut reads = with_lights(plan, inputs);
    if plan.smooths {
        reads.resize(2, vec![]);
        reads.push(vec![Slot::Outline, Slot::Coverage, Slot::OwnRays, Slot::OtherRays, Slot::COLOR]);
    }
    plan.changes_labels().then(|| Pass {
        feature: if plan.smooths { Feature::Edges } else { Feature::Finish },
        // Lines of ink end where something else is in front of a prop.
        group: FirstGroup::with_depth_if(is_resolved && plan.smooths || plan.has_ink, plan.samples),
        reads,
        writes: vec![Slot::Shown],
        depth: Some(if plan.smooths { Slot::EdgeMask } else { Slot::DEPTH }),
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(FINISH, Place::Posterize, Some(CachedResult::Labels), programs)
    })
}
