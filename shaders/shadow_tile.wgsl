// Copies a tile into a shadow map.

#import bevy_plenoctree::view::solid_depth_at_distance

// A part of the map to which a tile is copied.
struct Tile {
    // Transforms the unit square to this part, in clip space.
    clip_from_part: mat4x4<f32>,
    // The texel of the map where the tile begins.
    corner: vec2<i32>,
    // Where on the light's axis the distances in the tile begin.
    near: f32,
}

@group(0) @binding(2) var<storage, read> tiles: array<Tile>;

@group(1) @binding(0) var distances: texture_2d<f32>;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) tile: u32,
}

// One triangle over the part.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) tile: u32) -> Varying {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u));
    return Varying(tiles[tile].clip_from_part * vec4(corner, 0.0, 1.0), tile);
}

@fragment
fn fragment(in: Varying) -> @builtin(frag_depth) f32 {
    let distance = textureLoad(distances, vec2<i32>(in.position.xy) - tiles[in.tile].corner, 0).x;
    // Where the prop is not solid, the depth is infinitely far and never drawn.
    return select(solid_depth_at_distance(tiles[in.tile].near + distance), 0.0, distance < 0.0);
}
