// The depth of the scene, as bind group 0 holds it for the passes that read it.
#define_import_path bevy_plenoctree::scene

#import bevy_plenoctree::view::{depth_from_buffer, view}

#ifdef MULTISAMPLED
@group(0) @binding(7) var scene_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(7) var scene_depth: texture_depth_2d;
#endif

// Returns the depth of the scene at a sample of a pixel of the viewport.
fn scene_depth_at(pixel: vec2<u32>, sample: u32) -> f32 {
    return depth_from_buffer(textureLoad(scene_depth, pixel + view.corner, sample));
}

#ifdef MULTISAMPLED
// Returns the share of a pixel's samples at which a mesh is before this depth.
fn share_before(pixel: vec2<u32>, depth: f32) -> f32 {
    let samples = textureNumSamples(scene_depth);
    var count = 0u;
    for (var i = 0u; i < samples; i++) {
        count += select(0u, 1u, scene_depth_at(pixel, i) > depth);
    }
    return f32(count) / f32(samples);
}
#endif
