//! Posterization. See section 4 of the method.
//!
//! - *composite* blends the layer over the scene.
//! - *filter* flattens its colors (step 2).
//! - *label* replaces them by palette colors (steps 1 and 3 to 5). If nothing is posterized, it blends the layer over the
//!   scene itself.
//! - *blend* smooths the edges of posterized props. It first copies all pixels to a separate texture, because it reads
//!   what neighbors show.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::render_resource::CompareFunction,
    shader::{Shader, ShaderDefVal},
};

use crate::render::{
    frame::{
        Buffer, CachedResult, Clear, Draw, FirstGroup, Fragment, Input, Output, Pass, Place, Program, RaySet, Slot,
    },
    plan::{Feature, Plan},
};

pub(super) const COMPOSITE: &str = "plenoctree_composite";
pub(super) const FILTER: &str = "plenoctree_filter";
pub(super) const LABEL: &str = "plenoctree_label";
pub(super) const BLEND: &str = "plenoctree_blend";
pub(super) const STAGE: &str = "plenoctree_stage";

const COLOR: Input = Input::Texture(Slot::Color(RaySet::Pixels));
const OWNER: Input = Input::Texture(Slot::Owner(RaySet::Pixels));
pub(super) const DEPTH: Output = Output::Texture(Slot::Depth(RaySet::Pixels));

/// Blends the layer over the scene, in encoded sRGB.
pub(super) fn composite(plan: &Plan) -> Option<Pass> {
    let is_filtered = plan.iterations > 0;
    let program = Program::new("composite").define_all(space(plan.target.space)).define_if(!is_filtered, "UNFILTERED");
    let mut writes = vec![Some(Output::Texture(Slot::Even))];
    if is_filtered {
        // The filter does not write pixels without an owner, but reads them from both of its textures.
        writes.push(Some(Output::Texture(Slot::Odd)));
    }
    plan.posterizes.then(|| Pass {
        feature: Feature::Posterize,
        reads: vec![vec![COLOR, OWNER, Input::Scene]],
        writes,
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
        Pass {
            feature: Feature::Posterize,
            reads: vec![vec![Input::Texture(from)]],
            writes: vec![Some(Output::Texture(to))],
            depth: Some(DEPTH),
            draws: vec![Draw { instance: iteration, ..Draw::triangle(0) }],
            ..Pass::fullscreen(FILTER, Place::Posterize, Some(CachedResult::Composite), program.where_props_are())
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
    let mut reads = vec![source, COLOR];
    if plan.posterizes {
        reads.extend([Input::Texture(Slot::Depth(RaySet::Pixels)), Input::Scene]);
    }
    if plan.steadies() {
        reads.extend([Slot::FormerLabels, Slot::FormerDepth].map(Input::Texture));
    }
    let mut writes = vec![Some(Output::Texture(labeled(plan)))];
    if plan.needs_labels() {
        writes.push(Some(Output::Texture(Slot::Labels)));
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
        depth: Some(DEPTH),
        clear: Some(Clear::NegativeAlpha),
        ..Pass::fullscreen(LABEL, Place::Posterize, Some(CachedResult::Labels), program.where_props_are())
    }
}

/// Returns where the label pass writes colors. It, *finish* and *blend* write to two textures by turns, so that the
/// last one writes what is shown. They belong to the same result: none of them is ever drawn without those before it.
pub(super) fn labeled(plan: &Plan) -> Slot {
    if plan.smooths == plan.finishes() { Slot::Shown } else { Slot::Interim }
}

/// Smooths the edges of props.
pub(super) fn blend(plan: &Plan) -> Option<Pass> {
    // The target no longer has samples.
    let is_resolved = plan.samples > 1 && plan.hidden_samples().is_none() && !plan.posterizes_view;
    let program = Program::new("blend")
        .define_all(space(plan.target.space))
        .define_number("SAMPLES", plan.hidden_samples())
        .define_if(is_resolved, "RESOLVED")
        .define_if(plan.has_ink, "INK")
        .define_all(lit(plan));
    let slots = [Slot::Interim, Slot::Even, Slot::Outline, Slot::Coverage, Slot::OwnRays, Slot::OtherRays];
    let inputs = slots.into_iter().map(Input::Texture);
    let inputs = inputs.chain([Input::Scene, COLOR, Input::Texture(Slot::Depth(RaySet::Pixels))]);
    let inputs = inputs.chain(plan.has_ink.then_some(Input::Texture(Slot::Labels))).collect();
    plan.smooths.then(|| Pass {
        feature: Feature::Edges,
        group: FirstGroup::with_depth_if(is_resolved || plan.has_ink, plan.samples),
        reads: with_lights(plan, inputs),
        writes: vec![Some(Output::Texture(Slot::Shown))],
        depth: Some(Output::Texture(Slot::EdgeMask)),
        // The copy leaves out pixels beyond the drawn part, which custom stages may read.
        clear: Some(Clear::NegativeAlpha),
        programs: vec![Program::new("copy"), program.depth_test(CompareFunction::Less, false)],
        draws: vec![Draw::triangle(0), Draw::triangle(1)],
        ..Pass::fullscreen(BLEND, Place::Posterize, Some(CachedResult::Labels), Program::new("blend"))
    })
}

/// Custom stages, in turn from one texture to another.
pub(super) fn stages(plan: &Plan) -> Vec<Pass> {
    let pass = |(index, shader): (usize, &Handle<Shader>)| {
        let program = Program { fragment: Fragment::Custom(shader.clone()), ..Program::new("") };
        Pass {
            feature: Feature::Stages,
            reads: vec![[shown_after(index), Slot::Labels].map(Input::Texture).to_vec()],
            writes: vec![Some(Output::Texture(shown_after(index + 1)))],
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
    if plan.is_lit {
        let light = if plan.is_brightened { Slot::SmoothLight } else { Slot::Light };
        reads.push(vec![Input::Buffer(Buffer::Lit), Input::Texture(light), OWNER, Input::Buffer(Buffer::Shades)]);
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
