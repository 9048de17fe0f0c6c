// Blends the transparent objects in front of solid props over them.

#import bevy_plenoctree::view::{is_drawn, is_solid, view}

@group(1) @binding(0) var depth: texture_depth_2d;
// The objects alone, in the target's color space, with premultiplied alpha. It has the size of the target.
@group(1) @binding(1) var objects: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<u32>(position.xy);
    let pixel = at - view.corner;
    // Elsewhere, the props were drawn over the objects.
    if !is_drawn(pixel) || !is_solid(textureLoad(depth, pixel, 0)) {
        discard;
    }
    return textureLoad(objects, at, 0);
}
