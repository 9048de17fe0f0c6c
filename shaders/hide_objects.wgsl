// Hides transparent objects where props are, in the depth texture: those behind opaque parts, and where anything else
// shows through, all of them. Bloom then sees objects in front of opaque parts, although the props cover them.

#import bevy_plenoctree::prop_pixels::{is_at_edge, layer, shows_props}
#import bevy_plenoctree::view::{buffer_from_depth, is_solid, view}

@group(2) @binding(0) var depth: texture_depth_2d;

const NEAREST: f32 = 1.0;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    let pixel = vec2<u32>(position.xy) - view.corner;
    if !shows_props(pixel) {
        discard;
    }
    let solid = textureLoad(depth, pixel, 0);
    let is_opaque = textureLoad(layer, pixel, 0).a == 1.0 && is_solid(solid) && !is_at_edge(pixel);
    return select(NEAREST, buffer_from_depth(solid), is_opaque);
}
