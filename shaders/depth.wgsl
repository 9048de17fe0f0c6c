// Writes the depth and the motion of props where they are solid, for everything that is drawn later and for effects.

#import bevy_plenoctree::view::{buffer_from_depth, is_drawn, is_solid, nearest_drawn, view}

@group(1) @binding(1) var depth: texture_depth_2d;
#ifdef MOTION
@group(3) @binding(0) var motion: texture_2d<f32>;
#endif

struct Fragment {
    @builtin(frag_depth) depth: f32,
#ifdef MOTION
    @location(1) motion: vec4<f32>,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let at = vec2<u32>(position.xy) - view.corner;
    let pixel = nearest_drawn(vec2<i32>(at));
    let solid = textureLoad(depth, pixel, 0);
    if !is_drawn(at) || !is_solid(solid) {
        discard;
    }
    return Fragment(
        buffer_from_depth(solid),
#ifdef MOTION
        textureLoad(motion, pixel, 0),
#endif
    );
}
