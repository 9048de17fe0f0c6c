// The outline pass: finds the pixels at the edges of props, where the composite pass does not.

#import bevy_plenoctree::edge_owners::edge_at

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;

struct Fragment {
    // See `Edge`.
    @location(0) owners: vec2<u32>,
    @builtin(frag_depth) mask: f32,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let edge = edge_at(layer, owner, depth, vec2<i32>(position.xy));
    return Fragment(edge.owners, edge.mask);
}
