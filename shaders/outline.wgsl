// The outline pass: finds the pixels at the edges of posterized props, and the props that may cover parts of them.

#import bevy_plenoctree::owners::owners_at

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;

struct Fragment {
    // The result of `owners_at`.
    @location(0) owners: vec2<u32>,
#ifdef SEVERAL
    // As in `coverage.wgsl`, which adds to these.
    @location(1) bits: vec4<f32>,
    @location(2) own_color: vec4<f32>,
    @location(3) other_color: vec4<f32>,
#endif
    // 1 at the edges of props, and 0 elsewhere, for the depth test of the passes that follow.
    @builtin(frag_depth) mask: f32,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    var marked = Fragment();
    marked.owners = owners_at(layer, owner, depth, vec2<i32>(position.xy));
    marked.mask = select(0.0, 1.0, any(marked.owners > vec2(0u)));
    return marked;
}
