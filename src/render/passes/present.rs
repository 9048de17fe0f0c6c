//! Writes what labels or custom stages show to the camera's target, and the depth and the motion of props where they
//! are solid, for everything that is drawn later and for effects.

use bevy::render::render_resource::{BlendComponent, BlendState, CompareFunction};

use super::labels::{shown_after, space};
use crate::render::{
    frame::{Blend, Pass, Place, Program, RaySet, Slot},
    plan::{Feature, Plan},
};

pub(super) const PRESENT: &str = "plenoctree_present";

/// Writes colors and depth: at once, if the target and the depth texture have the same number of samples.
pub(super) fn present(plan: &Plan) -> Vec<Pass> {
    // Until custom stages or a posterized view decide what is shown, samples that show something in front of a prop
    // keep their color.
    let hidden = plan.hidden_samples().filter(|_| plan.smooths);
    let colors = Program::new("present").define_all(space(plan.target.space)).define_number("SAMPLES", hidden);
    let depth = Program::new("depth").define_if(plan.has_motion, "MOTION").depth_test(CompareFunction::Greater, true);
    // The colors are already composited: they are replaced, and alpha is blended over the target's alpha.
    let replace = Blend::With(BlendState { color: BlendComponent::REPLACE, alpha: BlendComponent::OVER });
    let of_edges = hidden.map_or(vec![], |_| vec![Slot::Outline, Slot::Coverage]);
    let of_motion = plan.has_motion.then_some(Slot::Motion(RaySet::Pixels));
    let shown = if plan.has_fog { Slot::Fogged } else { shown_after(plan.stages.len()) };
    let reads = vec![vec![shown, Slot::DEPTH], of_edges, of_motion.into_iter().collect()];
    let pass = |programs: Vec<Program>, writes, depth, samples| Pass {
        feature: if hidden.is_some() { Feature::Edges } else { Feature::Base },
        reads: reads.clone(),
        writes,
        depth,
        samples,
        ..Pass::fullscreen(PRESENT, Place::Present, None, programs)
    };
    let motion = plan.has_motion.then_some(Slot::PrepassMotion);
    if plan.target.samples == plan.samples {
        let colors = Program { blends: vec![replace, Blend::Masked], ..colors };
        let depth = Program { blends: vec![Blend::Masked, Blend::Replace], ..depth };
        let writes = [Slot::Target].into_iter().chain(motion).collect();
        return vec![pass(vec![colors, depth], writes, Some(Slot::TargetDepth), plan.samples)];
    }
    let colors = Program { blends: vec![replace], ..colors };
    vec![
        pass(vec![colors], vec![Slot::Target], None, plan.target.samples),
        pass(vec![depth], vec![], Some(Slot::TargetDepth), plan.samples),
    ]
}
