// The gather pass: takes the pixels of the batches to their places in the layer.

#import bevy_plenoctree::batch::{corner_at, place_in_batch}

// The results of the interpolate pass and of the volume pass.
@group(1) @binding(0) var indices: texture_2d<u32>;
@group(1) @binding(1) var color: texture_2d<f32>;
@group(1) @binding(2) var owner: texture_2d<f32>;
@group(1) @binding(3) var depth: texture_depth_2d;
#ifdef MOTION
@group(1) @binding(4) var motion: texture_2d<f32>;
#endif

struct Fragment {
    @location(0) color: vec4<f32>,
    @location(1) owner: vec4<f32>,
    @builtin(frag_depth) depth: f32,
#ifdef MOTION
    @location(2) motion: vec4<f32>,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy);
    let index = textureLoad(indices, pixel, 0).x;
    if index == 0u {
        discard;
    }
    let at = corner_at(pixel) + place_in_batch(index - 1u);
    return Fragment(
        textureLoad(color, at, 0),
        textureLoad(owner, at, 0),
        textureLoad(depth, at, 0),
#ifdef MOTION
        textureLoad(motion, at, 0),
#endif
    );
}
