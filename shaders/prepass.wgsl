// The prepass pass: writes the depth and the motion of solid props into the textures of Bevy's prepass.

#import bevy_plenoctree::view::{buffered, is_drawn, is_solid, view}

@group(1) @binding(0) var depth: texture_depth_2d;
#ifdef MOTION
@group(1) @binding(1) var motion: texture_2d<f32>;
#endif

struct Fragment {
#ifdef DEPTH
    @builtin(frag_depth) depth: f32,
#endif
#ifdef MOTION
    @location(0) motion: vec4<f32>,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy) - view.corner;
    let solid = textureLoad(depth, pixel, 0);
    if !is_drawn(pixel) || !is_solid(solid) {
        discard;
    }
    return Fragment(
#ifdef DEPTH
        buffered(solid),
#endif
#ifdef MOTION
        textureLoad(motion, pixel, 0),
#endif
    );
}
