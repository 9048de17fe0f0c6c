// The depth pass: writes the depth of props where they are solid, for everything that is drawn later.

#import bevy_plenoctree::view::{buffered, is_solid, view}

@group(1) @binding(0) var depth: texture_depth_2d;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    let solid = textureLoad(depth, vec2<u32>(position.xy) - view.corner, 0);
    if !is_solid(solid) {
        discard;
    }
    return buffered(solid);
}
