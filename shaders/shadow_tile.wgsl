// Copies a tile into a shadow map.

#import bevy_plenoctree::view::{props, solid_depth}

@group(1) @binding(0) var tile: texture_2d<f32>;

@fragment
fn fragment(
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) prop: u32,
) -> @builtin(frag_depth) f32 {
    // `reference` is the texel of the map where the tile begins.
    let distance = textureLoad(tile, vec2<i32>(position.xy) - vec2<i32>(props[prop].reference), 0).x;
    // Where the prop is not solid, the depth is infinitely far and never drawn.
    return select(solid_depth(prop, distance), 0.0, distance < 0.0);
}
