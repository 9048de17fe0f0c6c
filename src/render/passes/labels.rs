//! Posterization. See section 4 of the method.
//!
//! - *composite* blends the layer over the scene. If it can, it also finds the pixels at the edges of props.
//! - *filter* flattens its colors (step 2).
//! - *label* replaces them by palette colors (steps 1 and 3 to 5). If nothing is posterized, it blends the layer over the
//!   scene itself.
//! - *finish* smooths the borders between labels inside props (step 11), draws [ink](crate::Ink), and smooths the edges of
//!   props (step 6). None of this is in the paper.
//! - *stage* runs custom stages.
//! - *present* writes what is shown to the camera's target, and the depth and the motion of props where they are solid, for
//!   everything that is drawn later and for effects.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::{BlendComponent, BlendState, CompareFunction},
    shader::{Shader, ShaderDefVal},
};

use super::edges::outlining;
use crate::{
    gpu::pipelines::STAGE,
    render::{
        frame::{Blend, CachedResult, Clear, Draw, FirstGroup, Fragment, Pass, Place, Program, RaySet, Slot},
        plan::{Feature, Plan},
    },
};

pub(super) const COMPOSITE: &str = "plenoctree_composite";
pub(super) const FILTER: &str = "plenoctree_filter";
pub(super) const LABEL: &str = "plenoctree_label";
pub(super) const FINISH: &str = "plenoctree_finish";
pub(super) const PRESENT: &str = "plenoctree_present";

/// Blends the layer over the scene, in encoded sRGB.
pub(super) fn composite(plan: &Plan) -> Option<Pass> {
    let outlines = plan.composite_outlines();
    let program =
        Program::new("composite").define_all(space(plan.target.space)).define_if(plan.iterations == 0, "UNFILTERED");
    let program = program.define_if(plan.filters_apart, "APART");
    let pass = Pass {
        feature: Feature::Posterize,
        reads: vec![vec![Slot::COLOR, Slot::OWNER, Slot::DEPTH, Slot::Scene]],
        writes: vec![Slot::Even],
        covers_all: true,
        ..Pass::fullscreen(COMPOSITE, Place::Posterize, Some(CachedResult::Composite), vec![program])
    };
    plan.posterizes.then(|| if outlines { outlining(plan, pass) } else { pass })
}

/// The bilateral filter: in each iteration along rows, then along columns.
pub(super) fn filter(plan: &Plan) -> Vec<Pass> {
    let iterations = plan.iterations;
    let directions = [(Slot::Even, Slot::Odd), (Slot::Odd, Slot::Even)];
    let pass = |iteration, (from, to)| {
        let is_last = iteration + 1 == iterations && to == Slot::Even;
        let program = Program::new("filter").define_if(to == Slot::Odd, "HORIZONTAL").define_if(is_last, "LAST");
        // The first pass copies the pixels without an owner, which the others read from both textures, unless no owner
        // reads those of others. Then it leaves them out.
        let is_first = iteration == 0 && to == Slot::Odd;
        let copies = is_first && !plan.filters_apart;
        let program = if copies { program } else { program.where_props_are() };
        Pass {
            feature: Feature::Posterize,
            reads: vec![vec![from]],
            writes: vec![to],
            depth: Some(Slot::DEPTH),
            clear: (is_first && !copies).then_some(Clear::Zero),
            covers_all: copies,
            draws: vec![Draw { instance: iteration, ..Draw::triangle(0) }],
            ..Pass::fullscreen(FILTER, Place::Posterize, Some(CachedResult::Composite), vec![program])
        }
    };
    (0..iterations).flat_map(|iteration| directions.map(|direction| pass(iteration, direction))).collect()
}

/// Assigns labels.
pub(super) fn label(plan: &Plan) -> Pass {
    let source = if plan.posterizes { Slot::Even } else { Slot::Scene };
    let program = showing_labels("label", plan)
        .define_if(!plan.posterizes, "UNPOSTERIZED")
        .define_if(plan.needs_labels(), "LABEL_TEXTURES")
        .define_if(plan.steadies(), "STEADY");
    let mut reads = vec![source, Slot::COLOR];
    if plan.posterizes {
        reads.extend([Slot::DEPTH, Slot::Scene]);
    }
    if plan.steadies() {
        reads.extend([Slot::FormerLabels, Slot::FormerDepth]);
    }
    // The finish pass reads colors of neighbors, so it writes to another texture. Both belong to the same result: neither
    // is ever drawn without the other.
    let shown = if plan.changes_labels() { Slot::Interim } else { Slot::Shown };
    let mut writes = vec![shown];
    writes.extend(plan.needs_labels().then_some(Slot::Labels));
    Pass {
        feature: match () {
            () if plan.steadies() => Feature::Finish,
            () if plan.is_lit => Feature::Lighting,
            () if plan.posterizes => Feature::Posterize,
            () => Feature::Base,
        },
        reads: with_lights(plan, reads),
        writes,
        depth: Some(Slot::DEPTH),
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(LABEL, Place::Posterize, Some(CachedResult::Labels), vec![program.where_props_are()])
    }
}

/// Draws borders and lines over what the label pass shows, and then pixels at edges.
pub(super) fn finish(plan: &Plan) -> Option<Pass> {
    // The target no longer has samples.
    let is_resolved = plan.samples > 1 && plan.hidden_samples().is_none() && !plan.posterizes_view;
    let program = |name| showing_labels(name, plan).define_if(plan.has_ink, "INK");
    let inside = if plan.finishes() { program("finish") } else { Program::new("copy") };
    let at_edges =
        program("blend").define_number("TARGET_SAMPLES", plan.hidden_samples()).define_if(is_resolved, "RESOLVED");
    // Only where the mask of edges has props or, with `AT_EDGES`, their edges.
    let where_mask_is_nearer = |program: Program| program.depth_test(CompareFunction::Less, false);
    let mut programs = vec![if plan.smooths { where_mask_is_nearer(inside) } else { inside.where_props_are() }];
    programs.extend(plan.smooths.then(|| where_mask_is_nearer(at_edges.define("AT_EDGES"))));
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

/// Custom stages, in turn from one texture to another.
pub(super) fn stages(plan: &Plan) -> Vec<Pass> {
    let pass = |(index, shader): (usize, &Handle<Shader>)| {
        let program = Program { fragment: Fragment::Custom(shader.clone()), ..Program::new("") };
        Pass {
            feature: Feature::Stages,
            reads: vec![vec![shown_after(index), Slot::Labels]],
            writes: vec![shown_after(index + 1)],
            ..Pass::fullscreen(STAGE, Place::Posterize, None, vec![program])
        }
    };
    plan.stages.iter().enumerate().map(pass).collect()
}

/// Writes colors and depth: at once, if the target and the depth texture have the same number of samples.
pub(super) fn present(plan: &Plan) -> Vec<Pass> {
    // Until custom stages or a posterized view decide what is shown, samples that show something in front of a prop
    // keep their color.
    let hidden = plan.hidden_samples().filter(|_| plan.smooths);
    let colors = Program::new("present").define_all(space(plan.target.space)).define_number("TARGET_SAMPLES", hidden);
    let depth = Program::new("depth").define_if(plan.has_motion, "MOTION").depth_test(CompareFunction::Greater, true);
    // The colors are already composited: they are replaced, and alpha is blended over the target's alpha.
    let replace = Blend::With(BlendState { color: BlendComponent::REPLACE, alpha: BlendComponent::OVER });
    let of_edges = hidden.map_or(vec![], |_| vec![Slot::Outline, Slot::Coverage]);
    let of_motion = plan.has_motion.then_some(Slot::Motion(RaySet::Pixels));
    let shown = shown_after(plan.stages.len() + usize::from(plan.has_fog));
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

/// Returns where the result of the first `stages` custom stages is. Fog counts as another one. What is shown without them
/// may be cached, so they leave it as it is.
pub(super) fn shown_after(stages: usize) -> Slot {
    match stages {
        0 => Slot::Shown,
        _ => Slot::Staged(stages % 2),
    }
}

/// Returns what a pass reads, and what it reads about lights.
fn with_lights(plan: &Plan, inputs: Vec<Slot>) -> Vec<Vec<Slot>> {
    let lights = Slot::of_light(plan).map(|light| vec![Slot::Lit, light, Slot::OWNER, Slot::Shades]);
    [inputs].into_iter().chain(lights).collect()
}

/// Returns a program that shows labels in light.
fn showing_labels(name: &'static str, plan: &Plan) -> Program {
    let program = Program::new(name).define_all(space(plan.target.space));
    program.define_if(plan.is_lit, "LIGHTING").define_if(plan.is_brightened, "BRIGHTNESS")
}

/// Returns the shader definitions for `target.wgsl`.
pub(super) fn space(space: Option<CompositingSpace>) -> Vec<ShaderDefVal> {
    match space {
        Some(CompositingSpace::Srgb) => vec!["SRGB_TARGET".into()],
        Some(CompositingSpace::Oklab) => vec!["OKLAB_TARGET".into()],
        Some(CompositingSpace::Linear) | None => vec![],
    }
}
