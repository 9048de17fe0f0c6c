// The shadow pass: finds where a prop is solid along the rays of a light. Marches through densities alone.

#import bevy_plenoctree::constants::NO_LEAF
#import bevy_plenoctree::octree::{begin, density, next_leaf}
#import bevy_plenoctree::prop_ray::{Varying, position_of, prop_ray, solid_depth_at}
#import bevy_plenoctree::view::props

// One triangle over the scissor rectangle around the prop, which `clip_from_box` transforms the unit square to. Mesa's
// software rasterizer loses texels along edges that triangles share, such as those of a box.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) prop: u32) -> Varying {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u));
    return Varying(props[prop].clip_from_box * vec4(corner, 0.0, 1.0), prop, 0u);
}

@fragment
fn fragment(in: Varying) -> @builtin(frag_depth) f32 {
    let seen = prop_ray(in);
    if seen.span.x >= seen.span.y {
        discard;
    }
    let limit = props[in.prop].solid_transmittance;
    var transmittance = 1.0;
    var solid = -1.0;
    var walk = begin(seen.ray, seen.span.x);
    loop {
        if transmittance < limit {
            break;
        }
        let crossing = next_leaf(seen.ray, &walk, seen.span.y);
        if crossing.leaf == NO_LEAF {
            break;
        }
        let sigma = density(crossing.leaf);
        let before = transmittance;
        transmittance *= exp(-sigma * (crossing.exit - crossing.enter));
        let inside = position_of(limit, before, crossing, sigma);
        solid = select(solid, inside, solid < 0.0 && transmittance <= limit);
    }
    if solid < 0.0 {
        discard;
    }
    return solid_depth_at(seen, in.prop, solid);
}
