// The depth of the scene, as bind group 0 holds it for the passes that read it.
#define_import_path bevy_plenoctree::scene

#import bevy_plenoctree::view::{depth_from_buffer, view, distance_from_depth}

#ifdef MULTISAMPLED
@group(0) @binding(7) var scene_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(7) var scene_depth: texture_depth_2d;
#endif

// Returns the depth of the scene at a sample of a pixel of the viewport.
fn scene_depth_at(pixel: vec2<u32>, sample: u32) -> f32 {
    return depth_from_buffer(textureLoad(scene_depth, pixel + view.corner, sample));
}

// Returns the distance of the scene along the view axis at a pixel of the viewport.
fn scene_distance(pixel: vec2<u32>) -> f32 {
    return distance_from_depth(scene_depth_at(pixel, 0u));
}
