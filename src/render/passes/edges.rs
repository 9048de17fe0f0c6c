//! Finds how much of each edge pixel a posterized prop covers, so that it can be blended with the background:
//! section 4 of the method, step 6. The edges of the paper are hard.
//!
//! The *outline* pass finds the pixels at the edges of props, and the owners that may cover parts of them. The
//! *coverage* pass finds these parts: from opacity where it says enough, and elsewhere with several rays through the
//! pixel.

use bevy::{
    prelude::*,
    render::render_resource::{BlendComponent, BlendFactor, BlendOperation, BlendState, CompareFunction},
};

use super::volume::index_of;
use crate::{
    gpu::field_definitions,
    render::{
        frame::{Blend, CachedResult, Draw, FirstGroup, Pass, Place, Program, Slot},
        plan::{Feature, Plan},
        uniforms::Smooths,
    },
};

pub(super) const OUTLINE: &str = "plenoctree_outline";
pub(super) const COVERAGE: &str = "plenoctree_coverage";

/// The pixels of a prop that a pass draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pixels {
    /// All of them.
    All,
    /// Those that the prop owns, where another one may be before it. Writes where the rays reach it, for those that
    /// follow.
    OfOwners,
    /// The others: those that another prop owns or none does, and those where no other one may be before it.
    OfOthers,
}

/// Where the rays of edges reach owners. Whenever the layer is drawn, so is the composite, which replaces all of this.
const PLACES: Slot = Slot::Even;

/// Finds the pixels at edges, unless the composite pass does. Clears what the coverage pass adds to if there are several
/// props.
pub(super) fn outline(plan: &Plan) -> Option<Pass> {
    let is_several = plan.has_several_props;
    let rays: &[Slot] = if is_several { &[Slot::Coverage, Slot::OwnRays, Slot::OtherRays] } else { &[] };
    let program = Program::new("outline").define_if(is_several, "SEVERAL").define_if(plan.estimates_edges, "ESTIMATES");
    let program = program.depth_test(CompareFunction::Always, true);
    (plan.smooths && !plan.composite_outlines()).then(|| Pass {
        feature: Feature::Edges,
        reads: vec![vec![Slot::COLOR, Slot::OWNER, Slot::DEPTH]],
        writes: [&[Slot::Outline][..], rays].concat(),
        depth: Some(Slot::EdgeMask),
        covers_all: true,
        ..Pass::fullscreen(OUTLINE, Place::Layer, Some(CachedResult::Layer), vec![program])
    })
}

/// Finds which parts of these pixels props cover. Where props overlap, those before others are compared with them ray
/// by ray.
pub(super) fn coverage(plan: &Plan) -> Vec<Pass> {
    let pixels = match () {
        _ if !plan.smooths => &[][..],
        _ if plan.overlaps => &[Pixels::OfOwners, Pixels::OfOthers],
        _ => &[Pixels::All],
    };
    pixels.iter().map(|pixels| coverage_of(plan, *pixels)).collect()
}

fn coverage_of(plan: &Plan, pixels: Pixels) -> Pass {
    let sum =
        BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::One, operation: BlendOperation::Add };
    let add = Blend::With(BlendState { color: sum, alpha: sum });
    // A single prop writes all pixels at its edges, even where its rays do not meet its box.
    let is_single = !plan.has_several_props;
    let blend = if is_single { Blend::Replace } else { add };
    let (definition, third, blends) = match pixels {
        Pixels::All => (None, Slot::OtherRays, [blend; 3]),
        Pixels::OfOwners => (Some("OF_OWNERS"), PLACES, [add, add, Blend::Replace]),
        Pixels::OfOthers => (Some("OF_OTHERS"), Slot::OtherRays, [add; 3]),
    };
    let mut reads = vec![Slot::Outline, Slot::OWNER, Slot::DEPTH, Slot::COLOR];
    reads.extend((pixels == Pixels::OfOthers).then_some(PLACES));
    let (mut programs, mut draws, mut shapes) = (vec![], vec![], vec![]);
    for (index, prop) in plan.props.iter().enumerate().filter(|(_, prop)| prop.smooths != Smooths::Nothing) {
        let program = index_of(&mut shapes, prop.kind.shape, || {
            let program =
                Program { tree: Some(prop.kind.shape.into()), blends: blends.to_vec(), ..Program::new("coverage") };
            let program = definition.into_iter().fold(program, Program::define);
            let program = program.define_number("SAMPLES", Some(plan.samples));
            programs.push(program.define_all(field_definitions(prop.kind.shape)).where_edges_need_rays());
        });
        let scissor = (!is_single).then_some(prop.rect);
        let field = Some(prop.field.clone());
        draws.push(Draw { field, instance: index as u32, scissor, ..Draw::triangle(program) });
    }
    // Opacity is that of one prop where the boxes of no others are.
    if plan.estimates_edges && pixels != Pixels::OfOwners {
        let program = Program { blends: blends.to_vec(), ..Program::new("estimate") };
        programs.push(program.define_number("SAMPLES", Some(plan.samples)).at_estimated_edges());
        draws.push(Draw::triangle(programs.len() - 1));
    }
    let place = if plan.composite_outlines() { Place::Posterize } else { Place::Layer };
    Pass {
        feature: Feature::Edges,
        group: FirstGroup::SceneDepth(plan.samples),
        reads: vec![reads],
        writes: vec![Slot::Coverage, Slot::OwnRays, third],
        depth: Some(Slot::EdgeMask),
        draws,
        ..Pass::fullscreen(COVERAGE, place, Some(CachedResult::Layer), programs)
    }
}
