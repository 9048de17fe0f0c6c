// One triangle that covers the viewport.

#import bevy_plenoctree::view::{LEAST_DEPTH, NOWHERE, stale, view}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
#ifdef KEPT_LAYER
    if stale.layer == 0u {
        return NOWHERE;
    }
#endif
#ifdef KEPT_COMPOSITE
    if stale.composite == 0u {
        return NOWHERE;
    }
#endif
    // Passes that test the props' depth run only where a prop was drawn, or everywhere if the view is posterized.
    let depth = select(0.0, LEAST_DEPTH, view.everything == 0u);
    return vec4(vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, depth, 1.0);
}
