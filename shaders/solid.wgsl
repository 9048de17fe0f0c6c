// The solid pass: finds which of several props is solid nearest to the camera, and where. Marches through densities
// alone.

#import bevy_plenoctree::constants::NO_LEAF
#import bevy_plenoctree::octree::{begin, density, next_leaf}
#import bevy_plenoctree::prop_ray::{Varying, position_of, prop_ray, solid_depth_at}
#import bevy_plenoctree::view::{pack_solid, props, view}

struct Fragment {
    // The result of `pack_solid`.
    @location(0) solid: u32,
    // The depth test keeps the nearest prop.
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Varying) -> Fragment {
    let seen = prop_ray(in);
    if seen.span.x >= seen.span.y {
        discard;
    }
    let limit = props[in.prop].solid_transmittance;
    var transmittance = 1.0;
    var solid = -1.0;
    var walk = begin(seen.ray, seen.span.x);
    loop {
        if transmittance < view.stop_transmittance {
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
    let is_opaque = transmittance < view.stop_transmittance;
    return Fragment(pack_solid(in.prop, is_opaque), solid_depth_at(seen, in.prop, solid));
}
