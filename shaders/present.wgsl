// The present pass: writes the output of custom stages to the view's target.

#import bevy_plenoctree::target::to_target
#import bevy_plenoctree::view::{is_drawn, view}

@group(1) @binding(0) var colors: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy) - view.corner;
    let color = textureLoad(colors, pixel, 0);
    // Nothing is drawn where opacity is negative.
    if !is_drawn(pixel) || color.a < 0.0 {
        discard;
    }
    return vec4(to_target(color.rgb), color.a);
}
