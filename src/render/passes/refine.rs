//! Rays where the picture needs them, for views that do not cast a ray for every pixel.
//!
//! The volume pass first draws a *grid* of rays, one for every second pixel along each axis. The
//! *check* pass compares the rays around each *gap* between them, and collects the gaps where they differ in *batches*.
//! The pixels of these are marched in textures of their own, side by side, because graphics cards gain nothing by
//! leaving out single pixels. The *fill* pass takes the results to their places in the layer, and interpolates the rays
//! of the grid across all other gaps.

use bevy::render::render_resource::CompareFunction;

use super::volume::layer;
use crate::render::{
    frame::{CachedResult, FirstGroup, Pass, Place, Program, RaySet, Slot},
    plan::{Feature, Plan},
};

pub(super) const CHECK: &str = "plenoctree_check";
pub(super) const FILL: &str = "plenoctree_fill";

/// Finds the gaps whose pixels need rays.
pub(super) fn check(plan: &Plan) -> Pass {
    let [color, owner, depth] = [Slot::Color, Slot::Owner, Slot::Depth].map(|slot| slot(RaySet::Grid));
    Pass {
        feature: Feature::Sparse,
        group: FirstGroup::SceneDepth(plan.samples),
        reads: vec![vec![color, owner, depth]],
        stores: vec![Slot::BatchCounts, Slot::BatchGaps],
        writes: vec![Slot::Gaps],
        covers_all: true,
        zeroes: vec![Slot::BatchCounts],
        ..Pass::fullscreen(CHECK, Place::Layer, Some(CachedResult::Layer), vec![Program::new("check")])
    }
}

/// Completes the layer.
pub(super) fn fill(plan: &Plan) -> Pass {
    let of = |slot: fn(RaySet) -> Slot| [RaySet::Grid, RaySet::Batches].map(slot);
    let [[color, batched_color], [owner, batched_owner], [depth, batched_depth]] =
        [of(Slot::Color), of(Slot::Owner), of(Slot::Depth)];
    let mut reads = vec![Slot::Gaps, color, owner, depth, batched_color, batched_owner, batched_depth];
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
