// Hides transparent objects where props are: in the depth texture, the nearest depth is in front of them.

#import bevy_plenoctree::prop_pixels::shows_props
#import bevy_plenoctree::view::view

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @builtin(frag_depth) f32 {
    if !shows_props(vec2<u32>(position.xy) - view.corner) {
        discard;
    }
    return 1.0;
}
