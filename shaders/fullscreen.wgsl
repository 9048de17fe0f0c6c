// One triangle that covers the viewport.

#import bevy_plenoctree::view::{LEAST_DEPTH, NOWHERE, stale, view}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    // Later results are made from earlier ones.
#ifdef KEPT_LAYER
    let is_kept = stale.layer == 0u;
#else ifdef KEPT_COMPOSITE
    let is_kept = (stale.layer | stale.composite) == 0u;
#else ifdef KEPT_LABELS
    let is_kept = (stale.layer | stale.composite | stale.labels) == 0u;
#else
    let is_kept = false;
#endif
    if is_kept {
        return NOWHERE;
    }
    // Passes that test the props' depth run only where a prop was drawn, or everywhere if the view is posterized.
    let depth = select(0.0, LEAST_DEPTH, view.everything == 0u);
    return vec4(vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, depth, 1.0);
}
