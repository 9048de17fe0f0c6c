// Shows the transparent objects over props. Elsewhere, they were drawn before.

#import bevy_plenoctree::prop_pixels::shows_props
#import bevy_plenoctree::view::view

// The objects over the target. It has the size of the target.
@group(2) @binding(0) var objects: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<u32>(position.xy);
    if !shows_props(at - view.corner) {
        discard;
    }
    return textureLoad(objects, at, 0);
}
