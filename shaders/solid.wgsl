// The solid pass: finds which of several props is solid nearest to the camera, and where. Where others show through
// that prop, a second round finds the nearest one that is opaque. Marches through densities alone.

#import bevy_plenoctree::prop_ray::{Varying, march_to_solid, prop_ray, solid_depth_at}
#import bevy_plenoctree::view::{pack_solid, props, shows_through, view}

#ifdef SECOND_ROUND
// The result of the first round.
@group(2) @binding(0) var nearest: texture_2d<u32>;
#endif

struct Fragment {
    // The result of `pack_solid`.
    @location(0) solid: u32,
    // The depth test keeps the nearest prop.
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Varying) -> Fragment {
    let seen = prop_ray(in);
    var end = seen.span.y;
#ifdef SECOND_ROUND
    if !shows_through(textureLoad(nearest, vec2<u32>(in.position.xy), 0).x) {
        end = seen.span.x;
    }
#endif
    if seen.span.x >= end {
        discard;
    }
    let solid = march_to_solid(seen, end, props[in.prop].solid_transmittance, view.stop_transmittance);
    let is_opaque = solid.transmittance < view.stop_transmittance;
#ifdef SECOND_ROUND
    let is_found = solid.at >= 0.0 && is_opaque;
#else
    let is_found = solid.at >= 0.0;
#endif
    if !is_found {
        discard;
    }
    return Fragment(pack_solid(in.prop, is_opaque), solid_depth_at(seen, in.prop, solid.at));
}
