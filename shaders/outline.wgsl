// The outline pass: finds the pixels at the edges of props, where the composite pass does not.

#import bevy_plenoctree::edge_owners::edge_at

struct Fragment {
    // See `Edge`.
    @location(0) owners: vec2<u32>,
    @builtin(frag_depth) mask: f32,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let edge = edge_at(vec2<i32>(position.xy));
    return Fragment(edge.owners, edge.mask);
}
