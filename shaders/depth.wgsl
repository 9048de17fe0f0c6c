// The depth of the props, for what is drawn after them: where half of the light is gone.

#import bevy_plenoctree::view::{FAR_AWAY, depth_value, unpack_distance, view}

@group(1) @binding(0) var distances: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    let distance = unpack_distance(textureLoad(distances, vec2<u32>(position.xy) - view.corner, 0).xy);
    if distance >= FAR_AWAY {
        discard;
    }
    return clamp(depth_value(distance), 0.0, 1.0);
}
