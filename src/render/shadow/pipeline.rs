//! The passes that draw a prop into a shadow map. Only their pipelines are used.

use bevy::render::render_resource::CompareFunction;

use crate::{
    gpu::TreeShape,
    render::frame::{FirstGroup, Pass, Place, Program, Slot},
};

/// The name of the pass's span in Bevy's render diagnostics. There is one per camera, for all of its cascades, and one
/// for every map of a point or spot light.
pub const SHADOW_SPAN: &str = "plenoctree_shadow";

/// Returns the passes that march rays into the map, march rays into a tile, and copy a tile into the map.
pub(super) fn passes(tree: TreeShape) -> [Pass; 3] {
    // Bevy's maps have the depth order of the scene's depth texture.
    let shadow = Program::new("shadow").define("SHADOW_MAP").depth_test(CompareFunction::Greater, true);
    let program = |tree| Program { vertex: "shadow", tree, ..shadow.clone() };
    let pass = |program| Pass {
        group: FirstGroup::Map,
        depth: Some(Slot::TargetDepth),
        ..Pass::fullscreen(SHADOW_SPAN, Place::Layer, None, vec![program])
    };
    [
        pass(program(Some(tree))),
        Pass { writes: vec![Slot::ShadowTile], depth: None, ..pass(program(Some(tree)).define("TO_TILE")) },
        Pass { reads: vec![vec![Slot::ShadowTile]], ..pass(program(None).define("FROM_TILE")) },
    ]
}
