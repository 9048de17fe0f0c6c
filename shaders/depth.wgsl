// The depth pass: writes the depth of props where they are solid, for everything that is drawn later.

#import bevy_plenoctree::view::{solid_at, view}

@group(1) @binding(0) var owner: texture_2d<f32>;
@group(1) @binding(1) var depth: texture_depth_2d;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    let pixel = vec2<u32>(position.xy) - view.corner;
    if !solid_at(textureLoad(owner, pixel, 0)) {
        discard;
    }
    return textureLoad(depth, pixel, 0);
}
