// The field over what was drawn before it, in encoded sRGB: what the posterisation works on.

#import bevy_plenoctree::color::{encode, to_half}
#import bevy_plenoctree::view::view

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var scene: texture_2d<f32>;

// Both pictures of the filter hold the composite, so that it need not write the pixels that it leaves alone.
struct Fragment {
    @location(0) even: vec4<f32>,
    @location(1) odd: vec4<f32>,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy);
    let over = textureLoad(layer, pixel, 0);
    var background = textureLoad(scene, pixel + view.corner, 0).rgb;
    // An infinite light behind an opaque prop is no light.
    background = clamp(background, vec3(0.0), vec3(65504.0));
#ifndef ENCODED_TARGET
    background = encode(background);
#endif
    // Alpha carries the prop that posterises the pixel.
    let value = to_half(vec4(over.rgb + (1.0 - over.a) * background, textureLoad(owner, pixel, 0).r));
    return Fragment(value, value);
}
