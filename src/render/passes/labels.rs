//! Posterization. See section 4 of the method.
//!
//! - *composite* blends the layer over the scene. If it can, it also finds the pixels at the edges of props.
//! - *filter* flattens its colors (step 2).
//! - *label* replaces them by palette colors (steps 1 and 3 to 5). If nothing is posterized, it blends the layer over the
//!   scene itself.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    shader::{Shader, ShaderDefVal},
};

use super::edges::outlining;
use crate::gpu::pipelines::STAGE;
use crate::render::{
    frame::{CachedResult, Clear, Draw, Fragment, Pass, Place, Program, Slot},
    plan::{Feature, Plan},
};

pub(super) const COMPOSITE: &str = "plenoctree_composite";
pub(super) const FILTER: &str = "plenoctree_filter";
pub(super) const LABEL: &str = "plenoctree_label";

/// Blends the layer over the scene, in encoded sRGB.
pub(super) fn composite(plan: &Plan) -> Option<Pass> {
    let outlines = plan.composite_outlines();
    let program =
        Program::new("composite").define_all(space(plan.target.space)).define_if(plan.iterations == 0, "UNFILTERED");
    let mut reads = vec![Slot::COLOR, Slot::OWNER, Slot::Scene];
    reads.extend(outlines.then_some(Slot::DEPTH));
    let pass = Pass {
        feature: Feature::Posterize,
        reads: vec![reads],
        writes: vec![Slot::Even],
        covers_all: true,
        ..Pass::fullscreen(COMPOSITE, Place::Posterize, Some(CachedResult::Composite), vec![program])
    };
    plan.posterizes.then(|| if outlines { outlining(plan, pass) } else { pass })
}

/// The bilateral filter: in each iteration along rows, then along columns.
pub(super) fn filter(plan: &Plan) -> Vec<Pass> {
    let iterations = if plan.posterizes { plan.iterations } else { 0 };
    let directions = [(Slot::Even, Slot::Odd), (Slot::Odd, Slot::Even)];
    let pass = |iteration, (from, to)| {
        let is_last = iteration + 1 == iterations && to == Slot::Even;
        let program = Program::new("filter").define_if(to == Slot::Odd, "HORIZONTAL").define_if(is_last, "LAST");
        // The first pass copies the pixels without an owner, which the others read from both textures.
        let is_first = iteration == 0 && to == Slot::Odd;
        let program = if is_first { program } else { program.where_props_are() };
        Pass {
            feature: Feature::Posterize,
            reads: vec![vec![from]],
            writes: vec![to],
            depth: Some(Slot::DEPTH),
            covers_all: is_first,
            draws: vec![Draw { instance: iteration, ..Draw::triangle(0) }],
            ..Pass::fullscreen(FILTER, Place::Posterize, Some(CachedResult::Composite), vec![program])
        }
    };
    (0..iterations).flat_map(|iteration| directions.map(|direction| pass(iteration, direction))).collect()
}

/// Assigns labels.
pub(super) fn label(plan: &Plan) -> Pass {
    let source = if plan.posterizes { Slot::Even } else { Slot::Scene };
    let program = Program::new("label")
        .define_all(space(plan.target.space))
        .define_if(!plan.posterizes, "UNPOSTERIZED")
        .define_if(plan.needs_labels(), "LABEL_TEXTURES")
        .define_if(plan.steadies(), "STEADY")
        .define_all(lit(plan));
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

/// Returns where the result of the first `stages` custom stages is. What is shown without them may be cached, so they
/// leave it as it is.
pub(super) fn shown_after(stages: usize) -> Slot {
    match stages {
        0 => Slot::Shown,
        _ => Slot::Staged(stages % 2),
    }
}

/// Returns what a pass reads, and what it reads about lights.
pub(super) fn with_lights(plan: &Plan, inputs: Vec<Slot>) -> Vec<Vec<Slot>> {
    let lights = Slot::of_light(plan).map(|light| vec![Slot::Lit, light, Slot::OWNER, Slot::Shades]);
    [inputs].into_iter().chain(lights).collect()
}

/// Returns the shader definitions of what it reads about lights.
pub(super) fn lit(plan: &Plan) -> Vec<ShaderDefVal> {
    let lighting = plan.is_lit.then(|| "LIGHTING".into());
    lighting.into_iter().chain(plan.is_brightened.then(|| "BRIGHTNESS".into())).collect()
}

/// Returns the shader definitions for `target.wgsl`.
pub(super) fn space(space: Option<CompositingSpace>) -> Vec<ShaderDefVal> {
    match space {
        Some(CompositingSpace::Srgb) => vec!["SRGB_TARGET".into()],
        Some(CompositingSpace::Oklab) => vec!["OKLAB_TARGET".into()],
        Some(CompositingSpace::Linear) | None => vec![],
    }
}
