// One triangle that covers the view. Bind group 0 of passes that read Bevy's LIGHTS has nothing of the plugin.

#import bevy_plenoctree::edge::{MASK_OF_EDGES, MASK_OF_PROPS}
#import bevy_plenoctree::view::{LEAST_DEPTH, NOWHERE, first_drawn, screen}

struct Triangle {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) instance: u32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Triangle {
    // The result to which the pass contributes.
#ifdef CACHED
    if first_drawn > #{CACHED}u {
        return Triangle(NOWHERE, instance);
    }
#endif
    // Passes that test the props' depth run only where a prop was drawn, or everywhere if the view is posterized. Those
    // at edges test their mask. Between two depths, so that rounding does not matter.
#ifdef AT_EDGES
    let depth = 0.5 * (MASK_OF_PROPS + MASK_OF_EDGES);
#else ifdef LIGHTS
    let depth = 0.5 * LEAST_DEPTH;
#else
    let depth = select(0.0, 0.5 * LEAST_DEPTH, screen.view_posterize == 0u);
#endif
    return Triangle(vec4(vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, depth, 1.0), instance);
}
