// The field over what was drawn before it, in encoded sRGB: what the posterisation works on.

#import bevy_plenoctree::color::{encode, to_half}
#import bevy_plenoctree::view::view

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var scene: texture_2d<f32>;
@group(1) @binding(3) var even: texture_storage_2d<rgba16float, write>;
@group(1) @binding(4) var odd: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn composite(@builtin(global_invocation_id) pixel: vec3<u32>) {
    if any(pixel.xy >= view.size) {
        return;
    }
    let over = textureLoad(layer, pixel.xy, 0);
    var background = textureLoad(scene, pixel.xy + view.corner, 0).rgb;
#ifndef ENCODED_TARGET
    background = encode(background);
#endif
    // Alpha carries the prop that posterises the pixel. Both textures hold the picture, so that the filter need not
    // write the pixels that it leaves alone.
    let value = to_half(vec4(over.rgb + (1.0 - over.a) * background, textureLoad(owner, pixel.xy, 0).r));
    textureStore(even, pixel.xy, value);
    textureStore(odd, pixel.xy, value);
}
