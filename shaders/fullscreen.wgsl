// One triangle that covers the view. Bind group 0 of passes that read Bevy's LIGHTS has nothing of the plugin.

#import bevy_plenoctree::view::{LEAST_DEPTH, NOWHERE, screen, stale}

struct Triangle {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) instance: u32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Triangle {
    // Later results are made from earlier ones.
#ifdef CACHED_LAYER
    let is_cached = stale.layer == 0u;
#else ifdef CACHED_COMPOSITE
    let is_cached = (stale.layer | stale.composite) == 0u;
#else ifdef CACHED_LABELS
    let is_cached = (stale.layer | stale.composite | stale.labels) == 0u;
#else
    let is_cached = false;
#endif
    if is_cached {
        return Triangle(NOWHERE, instance);
    }
    // Passes that test the props' depth run only where a prop was drawn, or everywhere if the view is posterized.
#ifdef LIGHTS
    let depth = LEAST_DEPTH;
#else
    let depth = select(0.0, LEAST_DEPTH, screen.view_posterize == 0u);
#endif
    return Triangle(vec4(vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, depth, 1.0), instance);
}
