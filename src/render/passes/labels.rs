//! Posterization. See section 4 of the method.
//!
//! - *composite* blends the layer over the scene. If it can, it also finds the pixels at the edges of props.
//! - *filter* flattens its colors (step 2).
//! - *label* replaces them by palette colors (steps 1 and 3 to 5). If nothing is posterized, it blends the layer over the
//!   scene itself.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::CompareFunction,
    shader::{Shader, ShaderDefVal},
};

use crate::render::{
    frame::{Buffer, CachedResult, Clear, Draw, Fragment, Input, Output, Pass, Place, Program, Slot},
    plan::{Feature, Plan},
};

pub(super) const COMPOSITE: &str = "plenoctree_composite";
pub(super) const FILTER: &str = "plenoctree_filter";
pub(super) const LABEL: &str = "plenoctree_label";
pub(super) const STAGE: &str = "plenoctree_stage";

/// Blends the layer over the scene, in encoded sRGB.
pub(super) fn composite(plan: &Plan) -> Option<Pass> {
    let outlines = plan.composite_outlines();
    let program = Program::new("composite")
        .define_all(space(plan.target.space))
        .define_if(plan.iterations == 0, "UNFILTERED")
        .define_if(outlines, "OUTLINE")
        .depth_test(CompareFunction::Always, outlines);
    let mut reads = vec![Input::COLOR, Input::OWNER, Input::Scene];
    reads.extend(outlines.then_some(Input::DEPTH));
    let slots: &[Slot] = if outlines { &[Slot::Even, Slot::Outline] } else { &[Slot::Even] };
    plan.posterizes.then(|| Pass {
        feature: if outlines { Feature::Edges } else { Feature::Posterize },
        reads: vec![reads],
        writes: slots.iter().map(|slot| Output::Texture(*slot)).collect(),
        depth: outlines.then_some(Output::Texture(Slot::EdgeMask)),
        ..Pass::fullscreen(COMPOSITE, Place::Posterize, Some(CachedResult::Composite), program)
    })
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
            reads: vec![vec![Input::Texture(from)]],
            writes: vec![Output::Texture(to)],
            depth: Some(Output::DEPTH),
            draws: vec![Draw { instance: iteration, ..Draw::triangle(0) }],
            ..Pass::fullscreen(FILTER, Place::Posterize, Some(CachedResult::Composite), program)
        }
    };
    (0..iterations).flat_map(|iteration| directions.map(|direction| pass(iteration, direction))).collect()
}

/// Assigns labels.
pub(super) fn label(plan: &Plan) -> Pass {
    let source = if plan.posterizes { Input::Texture(Slot::Even) } else { Input::Scene };
    let program = Program::new("label")
        .define_all(space(plan.target.space))
        .define_if(!plan.posterizes, "UNPOSTERIZED")
        .define_if(plan.needs_labels(), "LABEL_TEXTURES")
        .define_if(plan.steadies(), "STEADY")
        .define_all(lit(plan));
    let mut reads = vec![source, Input::COLOR];
    if plan.posterizes {
        reads.extend([Input::DEPTH, Input::Scene]);
    }
    if plan.steadies() {
        reads.extend([Slot::FormerLabels, Slot::FormerDepth].map(Input::Texture));
    }
    // The finish pass reads colors of neighbors, so it writes to another texture. Both belong to the same result: neither
    // is ever drawn without the other.
    let shown = if plan.changes_labels() { Slot::Interim } else { Slot::Shown };
    let mut writes = vec![Output::Texture(shown)];
    if plan.needs_labels() {
        writes.push(Output::Texture(Slot::Labels));
    }
    Pass {
        feature: match () {
            () if plan.steadies() => Feature::Finish,
            () if plan.is_lit => Feature::Lighting,
            () if plan.posterizes => Feature::Posterize,
            () => Feature::Base,
        },
        reads: with_lights(plan, reads),
        writes,
        depth: Some(Output::DEPTH),
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(LABEL, Place::Posterize, Some(CachedResult::Labels), program.where_props_are())
    }
}

/// Custom stages, in turn from one texture to another.
pub(super) fn stages(plan: &Plan) -> Vec<Pass> {
    let pass = |(index, shader): (usize, &Handle<Shader>)| {
        let program = Program { fragment: Fragment::Custom(shader.clone()), ..Program::new("") };
        Pass {
            feature: Feature::Stages,
            reads: vec![[shown_after(index), Slot::Labels].map(Input::Texture).to_vec()],
            writes: vec![Output::Texture(shown_after(index + 1))],
            ..Pass::fullscreen(STAGE, Place::Posterize, None, program)
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
pub(super) fn with_lights(plan: &Plan, inputs: Vec<Input>) -> Vec<Vec<Input>> {
    let mut reads = vec![inputs];
    if let Some(light) = Slot::of_light(plan) {
        let [settings, shades] = [Buffer::Lit, Buffer::Shades].map(Input::Buffer);
        reads.push(vec![settings, Input::Texture(light), Input::OWNER, shades]);
    }
    reads
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
