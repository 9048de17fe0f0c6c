// The outline pass: finds the pixels at the edges of props, where the composite pass does not.

#import bevy_plenoctree::edge_owners::edge_at

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;

struct Fragment {
    // See `Edge`.
    @location(0) owners: vec2<u32>,
#ifdef SEVERAL
    // As in `coverage.wgsl`, which adds to these.
    @location(1) bits: vec4<f32>,
    @location(2) own_color: vec4<f32>,
    @location(3) other_color: vec4<f32>,
#endif
    @builtin(frag_depth) mask: f32,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<i32>(position.xy);
    var marked = Fragment();
    let edge = edge_at(layer, owner, depth, pixel);
    marked.owners = edge.owners;
    marked.mask = edge.mask;
    return marked;
}
