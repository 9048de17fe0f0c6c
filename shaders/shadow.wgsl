// The shadow pass: finds where a prop is solid along the rays of a light. Marches through densities alone, or reads from
// a tile what earlier rays have found.

#import bevy_plenoctree::prop_ray::{Varying, march_to_solid, prop_ray}
#import bevy_plenoctree::view::{props, solid_depth}

#ifdef FROM_TILE
// The tile begins at the texel `reference` of the map.
@group(1) @binding(0) var distances: texture_2d<f32>;
#endif

// One triangle over a part of the map or the tile, which `clip_from_box` transforms the unit square to.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) prop: u32) -> Varying {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u));
    return Varying(props[prop].clip_from_box * vec4(corner, 0.0, 1.0), prop, 0u);
}

// Returns where the prop is solid along the light's axis, from where its rays begin. Negative if it is not.
fn solid_distance(in: Varying) -> f32 {
#ifdef FROM_TILE
    return textureLoad(distances, vec2<i32>(in.position.xy) - vec2<i32>(props[in.prop].reference), 0).x;
#else
    let seen = prop_ray(in);
    let limit = props[in.prop].solid_transmittance;
    return march_to_solid(seen, seen.span.y, limit, limit).at / seen.length;
#endif
}

#ifdef TO_TILE
@fragment
fn fragment(in: Varying) -> @location(0) f32 {
    return solid_distance(in);
}
#else
@fragment
fn fragment(in: Varying) -> @builtin(frag_depth) f32 {
    let distance = solid_distance(in);
    if distance < 0.0 {
        discard;
    }
    return solid_depth(in.prop, distance);
}
#endif
