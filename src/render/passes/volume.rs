//! Draws the props into the view's layer, back to front. See section 2 of the method.
//!
//! Where props overlap, the *solid* pass first finds, for every pixel, the prop that is solid nearest to the camera,
//! and where. Where others show through that prop, a second round finds the nearest one that is opaque. The *volume*
//! pass cuts the props there: it draws all parts behind that depth, then the prop that is solid there, then all parts
//! in front of it. A solid part thus hides what is behind it and shows what is in front of it, regardless of the order
//! in which props are drawn.
//!
//! Views that do not cast a ray for every pixel first draw a *grid* of rays, one for every second pixel along each axis.
//! The *check* pass compares the rays around each *gap* between them, and collects the gaps where they differ in
//! *batches*. The pixels of these are marched in textures of their own, side by side, because graphics cards gain nothing
//! by leaving out single pixels. The *fill* pass takes the results to their places in the layer, and interpolates the
//! rays of the grid across all other gaps.

use bevy::{prelude::*, render::render_resource::*};

use crate::{
    gpu::{FieldShape, TreeShape, field_definitions},
    render::{
        frame::{BOX, Blend, CachedResult, Clear, Draw, FirstGroup, Pass, Pipelines, Place, Program, RaySet, Slot},
        plan::{Feature, Kind, Plan, PlannedProp},
    },
};

pub(super) const VOLUME: &str = "plenoctree_volume";
pub(super) const VOLUME_BATCHES: &str = "plenoctree_volume_batches";
pub(super) const SOLID: &str = "plenoctree_solid";
pub(super) const SOLID_BATCHES: &str = "plenoctree_solid_batches";
pub(super) const CHECK: &str = "plenoctree_check";
pub(super) const FILL: &str = "plenoctree_fill";

const VERTICES_OF_BOX: std::ops::Range<u32> = 0..36;

/// The pieces of props that overlap, in drawing order. They match `volume.wgsl`.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Piece {
    /// What is behind the solid depth, where it shows through.
    Behind,
    /// All of the prop that is solid there.
    Solid,
    /// What is in front of the solid depth, or everything if there is none.
    Before,
}

impl Piece {
    /// Returns whether a prop may have this piece. Props that do not overlap others are drawn in one.
    fn is_of(self, prop: &PlannedProp) -> bool {
        match self {
            Self::Behind => prop.kind.overlaps,
            Self::Solid => prop.may_hide(),
            Self::Before => true,
        }
    }
}

/// Finds the nearest solid props, in two rounds.
pub(super) fn solid(plan: &Plan, rays: RaySet) -> Vec<Pass> {
    if !plan.overlaps {
        return vec![];
    }
    let rounds = [(Slot::Nearest(rays), Slot::NearestDepth(rays)), (Slot::Opaque(rays), Slot::OpaqueDepth(rays))];
    let name = if rays == RaySet::Batches { SOLID_BATCHES } else { SOLID };
    let pass = |(round, (prop, depth)): (usize, (Slot, Slot))| {
        let mut pass = marching(name, plan, rays);
        pass.writes = vec![prop];
        pass.depth = Some(depth);
        if round > 0 {
            pass.reads = vec![vec![Slot::Nearest(rays)]];
        }
        let mut trees = vec![];
        // Front to back: of equal depths, the first one stays.
        for (index, prop) in plan.props.iter().enumerate().rev().filter(|(_, prop)| prop.may_hide()) {
            let tree = TreeShape::from(prop.kind.shape);
            let program = index_of(&mut trees, tree, || {
                let program =
                    through(Program::new("solid"), rays, prop.kind.shape).define_if(round > 0, "SECOND_ROUND");
                pass.programs.push(program.depth_test(CompareFunction::Greater, true));
            });
            pass.draws.extend(draw(rays, prop, program, index as u32));
        }
        pass
    };
    rounds.into_iter().enumerate().map(pass).collect()
}

/// Draws the props.
pub(super) fn volume(plan: &Plan, rays: RaySet) -> Pass {
    let mut pass = volume_of(plan, rays);
    let mut kinds = vec![];
    let pieces = if plan.overlaps { &[Piece::Behind, Piece::Solid, Piece::Before][..] } else { &[Piece::Before] };
    for piece in pieces {
        for (index, prop) in plan.props.iter().enumerate().filter(|(_, prop)| piece.is_of(prop)) {
            let program = index_of(&mut kinds, prop.kind, || pass.programs.push(volume_program(plan, rays, prop.kind)));
            pass.draws.extend(draw(rays, prop, program, index as u32 | (*piece as u32) << 16));
        }
    }
    pass
}

/// Returns the volume pass without its draws.
fn volume_of(plan: &Plan, rays: RaySet) -> Pass {
    let mut pass = marching(if rays == RaySet::Batches { VOLUME_BATCHES } else { VOLUME }, plan, rays);
    if plan.overlaps {
        let slots = [Slot::Nearest, Slot::NearestDepth, Slot::Opaque, Slot::OpaqueDepth];
        pass.reads = vec![slots.map(|slot| slot(rays)).to_vec()];
    }
    pass.writes = layer(plan, rays);
    pass.depth = Some(Slot::Depth(rays));
    pass
}

/// Returns the color attachments of a layer.
fn layer(plan: &Plan, rays: RaySet) -> Vec<Slot> {
    let mut writes = vec![Slot::Color(rays)];
    writes.extend(plan.has_owners().then_some(Slot::Owner(rays)));
    writes.extend(plan.has_motion.then_some(Slot::Motion(rays)));
    writes
}

fn volume_program(plan: &Plan, rays: RaySet, kind: Kind) -> Program {
    let Kind { shape, overlaps, is_lit, may_recolor } = kind;
    let over = |src_factor| {
        let (dst_factor, operation) = (BlendFactor::OneMinusSrcAlpha, BlendOperation::Add);
        let color = BlendComponent { src_factor, dst_factor, operation };
        Blend::With(BlendState { color, alpha: BlendComponent::OVER })
    };
    let program = through(Program::new("volume"), rays, shape);
    Program {
        reads: overlaps,
        // The nearest prop that is opaque enough owns the pixel, and so does its motion.
        blends: vec![over(BlendFactor::One), over(BlendFactor::SrcAlpha), over(BlendFactor::SrcAlpha)],
        ..program
    }
    .define_all(field_definitions(shape))
    .define_if(overlaps, "OVERLAPPING")
    .define_if(is_lit, "LIT")
    .define_if(may_recolor, "RECOLORED")
    .define_if(plan.has_fog, "FOG")
    .define_if(plan.has_owners(), "OWNERS")
    .define_number("MOTION", plan.has_motion.then(|| 1 + u32::from(plan.has_owners())))
    // The depth is written, not tested: where a prop is solid, all write the same, and in haze, the last one counts.
    .depth_test(CompareFunction::Always, true)
}

/// Returns a pass that marches through props, without its draws.
fn marching(name: &'static str, plan: &Plan, rays: RaySet) -> Pass {
    Pass {
        feature: if plan.is_sparse { Feature::Sparse } else { Feature::Base },
        group: match rays {
            RaySet::Batches => FirstGroup::Batches(plan.samples, Slot::BatchGaps),
            RaySet::Pixels | RaySet::Grid => FirstGroup::SceneDepth(plan.samples),
        },
        clear: Some(Clear::Zero),
        ..Pass::fullscreen(name, Place::Layer, Some(CachedResult::Layer), vec![])
    }
}

/// Returns a program that marches through fields of a shape.
pub(super) fn through(program: Program, rays: RaySet, shape: FieldShape) -> Program {
    let vertex = if rays == RaySet::Batches { "batches" } else { BOX };
    Program { vertex, tree: Some(shape.into()), ..program }
}

/// Returns what draws a prop: its box, or all batches that may have pixels in it.
fn draw(rays: RaySet, prop: &PlannedProp, program: usize, instance: u32) -> Option<Draw> {
    let draw = Draw { program, field: Some(prop.field.clone()), vertices: VERTICES_OF_BOX, instance };
    if rays == RaySet::Batches { draw.of_batches(prop.batches().1) } else { Some(draw) }
}

/// Returns the index of a key in a list. Appends it if it is new, and calls `add`.
pub(super) fn index_of<K: PartialEq>(keys: &mut Vec<K>, key: K, add: impl FnOnce()) -> usize {
    keys.iter().position(|known| *known == key).unwrap_or_else(|| {
        keys.push(key);
        add();
        keys.len() - 1
    })
}

/// Finds the gaps whose pixels need rays.
pub(super) fn check(plan: &Plan) -> Pass {
    let [color, owner, depth] = [Slot::Color, Slot::Owner, Slot::Depth].map(|slot| slot(RaySet::Grid));
    Pass {
        feature: Feature::Sparse,
        group: FirstGroup::SceneDepth(plan.samples),
        reads: vec![vec![color, owner, depth]],
        stores: vec![Slot::BatchGaps],
        writes: vec![Slot::Gaps],
        covers_all: true,
        ..Pass::fullscreen(CHECK, Place::Layer, Some(CachedResult::Layer), vec![Program::new("check")])
    }
}

/// Completes the layer.
pub(super) fn fill(plan: &Plan) -> Pass {
    let of = |slot: fn(RaySet) -> Slot| [RaySet::Grid, RaySet::Batches].map(slot);
    let [[color, batched_color], [owner, batched_owner], [depth, batched_depth]] =
        [of(Slot::Color), of(Slot::Owner), of(Slot::Depth)];
    let mut reads = vec![Slot::Gaps, Slot::BatchGaps, color, owner, depth, batched_color, batched_owner, batched_depth];
    if plan.has_motion {
        reads.extend(of(Slot::Motion));
    }
    let program = Program::new("fill").define_if(plan.has_motion, "MOTION").depth_test(CompareFunction::Always, true);
    Pass {
        feature: Feature::Sparse,
        reads: vec![reads],
        writes: layer(plan, RaySet::Pixels),
        depth: Some(Slot::DEPTH),
        covers_all: true,
        ..Pass::fullscreen(FILL, Place::Layer, Some(CachedResult::Layer), vec![program])
    }
}

/// Requests the pipelines of props of these kinds.
pub(in crate::render) fn request(plan: &Plan, kinds: &[Kind], pipelines: &mut Pipelines, cache: &PipelineCache) {
    let pass = volume_of(plan, RaySet::Pixels);
    for kind in kinds {
        pipelines.get(cache, &pass, &volume_program(plan, RaySet::Pixels, *kind), plan.target.format);
    }
}
