// The upsample pass: enlarges the coarse layer to the size of the viewport. Interpolates bilinearly, but not across
// edges in the scene's depth.

#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::scene::scene_distance
#import bevy_plenoctree::view::{pack_owner, packed_owner, prop_of, props, view}

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;
#ifdef MOTION
@group(1) @binding(3) var motion: texture_2d<f32>;
#endif

struct Fragment {
    @location(0) color: vec4<f32>,
    @location(1) owner: vec4<f32>,
    @builtin(frag_depth) depth: f32,
#ifdef MOTION
    @location(2) motion: vec4<f32>,
#endif
}

fn pow16(x: f32) -> f32 {
    let x2 = x * x;
    let x4 = x2 * x2;
    let x8 = x4 * x4;
    return x8 * x8;
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let here = scene_distance(vec2<u32>(position.xy));
    let at = position.xy / view.pixel - 0.5;
    let corner = vec2<i32>(floor(at));
    let share = at - floor(at);
    let last = vec2<i32>(textureDimensions(layer)) - 1;
    var color = vec4(0.0);
    var total = 0.0;
    var best = 0.0;
    var nearest = vec2(0);
    for (var tap = 0; tap < 4; tap++) {
        let offset = vec2(tap & 1, tap >> 1u);
        let pixel = clamp(corner + offset, vec2(0), last);
        let value = textureLoad(layer, pixel, 0);
        let along = mix(1.0 - share, share, vec2<f32>(offset));
        // The ray of that coarse pixel ended at the scene's depth there.
        let there = scene_distance(vec2<u32>((vec2<f32>(pixel) + 0.5) * view.pixel));
        // Distances of parallel rays can be negative.
        let likeness = pow16(1.0 - min(abs(here - there) / max(max(abs(here), abs(there)), 1e-30), 1.0));
        let weight = along.x * along.y * (likeness + 1e-4);
        color += weight * value;
        total += weight;
        if weight * value.a > best {
            best = weight * value.a;
            nearest = pixel;
        }
    }
    if best == 0.0 {
        // The pixel may hold what was drawn before.
        return Fragment();
    }
    let mixed = to_half(color / total);
    let there = textureLoad(owner, nearest, 0);
    // Outlines follow the interpolated opacity, not that of the coarse pixels.
    let covers = mixed.a >= props[max(prop_of(there), 1u) - 1u].min_opacity;
    let owned = pack_owner(select(0u, packed_owner(there), covers));
    return Fragment(
        mixed,
        vec4(owned, 0.0, 1.0),
        textureLoad(depth, nearest, 0),
#ifdef MOTION
        textureLoad(motion, nearest, 0),
#endif
    );
}
