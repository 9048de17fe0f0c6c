// The field over what was drawn before it, in encoded sRGB: what the posterisation works on.

#import bevy_plenoctree::color::{cielab, to_half}
#import bevy_plenoctree::target::from_target
#import bevy_plenoctree::view::view

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var scene: texture_2d<f32>;

struct Fragment {
    @location(0) color: vec4<f32>,
    @location(1) lab: vec4<f32>,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy);
    let over = textureLoad(layer, pixel, 0);
    let background = from_target(textureLoad(scene, pixel + view.corner, 0).rgb);
    let prop = textureLoad(owner, pixel, 0).r;
    // Alpha carries what posterises the pixel.
    let posterized = select(prop, f32(view.everything), prop == 0.0);
    let value = to_half(vec4(over.rgb + (1.0 - over.a) * background, posterized));
    return Fragment(value, vec4(cielab(value.rgb), 0.0));
}
