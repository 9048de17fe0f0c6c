//! Finds how much of each edge pixel a posterized prop covers, so that it can be blended with the background:
//! section 4 of the method, step 6. The edges of the paper are hard.
//!
//! The *outline* pass finds the pixels at the edges of props, and the owners that may cover parts of them: from opacity
//! where it says enough. It lists the others in batches, for each field. The *coverage* pass marches several rays through
//! each of these, side by side: edges are thin, and graphics cards gain nothing by leaving out single pixels.

use std::ops::Range;

use bevy::{prelude::*, render::render_resource::CompareFunction};

use super::volume::{index_of, through};
use crate::{
    gpu::field_definitions,
    render::{
        frame::{CachedResult, Draw, FirstGroup, Pass, Place, Program, RaySet, Slot, VERTICES_OF_BATCH},
        plan::{BATCH, Feature, Plan, PlannedProp, batches},
        uniforms::Smooths,
    },
};

pub(super) const OUTLINE: &str = "plenoctree_outline";
pub(super) const COVERAGE: &str = "plenoctree_coverage";

/// The listed pixels that a pass draws, for one of the owners that may cover parts of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pixels {
    /// Those that a prop owns where another one may be before it, for the owner. Writes where the rays reach it, for the
    /// others.
    OfOwners,
    /// All of them, for the other one, or if there is none, for the owner.
    OfOthers,
    /// All of them, if there is one prop.
    All,
}

/// Where the rays of edges reach owners. Whenever the layer is drawn, so is the composite, which replaces all of this.
const PLACES: Slot = Slot::Even;

/// What is known of the pixels at edges.
const FOUND: [Slot; 3] = [Slot::Coverage, Slot::OwnRays, Slot::OtherRays];

/// Lets a pass find the pixels at edges.
pub(super) fn outlining(plan: &Plan, pass: Pass) -> Pass {
    let define = |program: Program| {
        let program = program.define("OUTLINE").define_if(plan.estimates_edges, "ESTIMATES");
        let program = program.define_number("SAMPLES", Some(plan.samples));
        program.depth_test(CompareFunction::Always, true)
    };
    Pass {
        feature: Feature::Edges,
        group: FirstGroup::SceneDepth(plan.samples),
        stores: [&FOUND[..], &[Slot::BatchEdges]].concat(),
        writes: [&pass.writes[..], &[Slot::Outline]].concat(),
        depth: Some(Slot::EdgeMask),
        covers_all: true,
        programs: pass.programs.into_iter().map(define).collect(),
        ..pass
    }
}

/// Finds the pixels at edges, unless the composite pass does.
pub(super) fn outline(plan: &Plan) -> Option<Pass> {
    let programs = vec![Program::new("outline")];
    let pass = Pass {
        reads: vec![vec![Slot::COLOR, Slot::OWNER, Slot::DEPTH]],
        ..Pass::fullscreen(OUTLINE, Place::Layer, Some(CachedResult::Layer), programs)
    };
    (plan.smooths && !plan.composite_outlines()).then(|| outlining(plan, pass))
}

/// Finds which parts of these pixels props cover. Those before others are compared with them ray by ray.
pub(super) fn coverage(plan: &Plan) -> Vec<Pass> {
    let pixels = match () {
        _ if !plan.smooths => &[][..],
        _ if plan.has_several_props => &[Pixels::OfOwners, Pixels::OfOthers],
        _ => &[Pixels::All],
    };
    pixels.iter().map(|pixels| coverage_of(plan, *pixels)).collect()
}

fn coverage_of(plan: &Plan, pixels: Pixels) -> Pass {
    let mut reads = vec![Slot::Outline, Slot::OWNER, Slot::DEPTH];
    reads.extend((pixels == Pixels::OfOthers).then_some(PLACES));
    let (mut programs, mut draws, mut shapes, mut fields) = (vec![], vec![], vec![], vec![]);
    for (index, prop) in plan.props.iter().enumerate().filter(|(_, prop)| prop.smooths != Smooths::Nothing) {
        let program = index_of(&mut shapes, prop.kind.shape, || {
            let program = through(Program::new("coverage"), RaySet::Batches, prop.kind.shape);
            let program = program.define_if(pixels == Pixels::OfOwners, "OF_OWNERS");
            let program = program.define_if(pixels == Pixels::OfOthers, "OF_OTHERS");
            let program = program.define_number("PART", Some((pixels == Pixels::OfOwners).into()));
            let program = program.define_number("SAMPLES", Some(plan.samples));
            programs.push(program.define_all(field_definitions(prop.kind.shape)));
        });
        // The pixels of all props of a field are drawn at once: the rows of batches that have some.
        let rows = rows_at_edges(prop, plan.rect.size);
        let draw = index_of(&mut fields, prop.field.id(), || {
            let field = Some(prop.field.clone());
            draws.push(Draw { field, instance: index as u32, vertices: rows.clone(), ..Draw::triangle(program) });
        });
        let drawn = &mut draws[draw].vertices;
        *drawn = drawn.start.min(rows.start)..drawn.end.max(rows.end);
    }
    let place = if plan.composite_outlines() { Place::Posterize } else { Place::Layer };
    Pass {
        feature: Feature::Edges,
        group: FirstGroup::Batches(plan.samples, Slot::BatchEdges),
        reads: vec![reads],
        stores: if pixels == Pixels::OfOwners { [FOUND[0], FOUND[1], PLACES] } else { FOUND }.to_vec(),
        // Render passes need an attachment.
        depth: Some(Slot::EdgeMask),
        draws,
        ..Pass::fullscreen(COVERAGE, place, Some(CachedResult::Layer), programs)
    }
}

/// Returns the vertices of the rows of batches that may have pixels at the edges of a prop: those of its box and the
/// pixels next to it.
fn rows_at_edges(prop: &PlannedProp, size: UVec2) -> Range<u32> {
    let row = VERTICES_OF_BATCH * batches(size).x;
    let low = prop.rect.min.y.saturating_sub(1) / BATCH;
    let high = batches((prop.rect.max + 1).min(size)).y;
    row * low..row * high
}
