// Restores the depth of the scene where it hid transparent objects.

#import bevy_plenoctree::prop_pixels::shows_props
#import bevy_plenoctree::view::{scene_depth, view}

struct Varying {
    @builtin(position) position: vec4<f32>,
#ifdef MULTISAMPLED
    @builtin(sample_index) sample: u32,
#endif
}

@fragment
fn fragment(in: Varying) -> @builtin(frag_depth) f32 {
    let at = vec2<u32>(in.position.xy);
    if !shows_props(at - view.corner) {
        discard;
    }
#ifdef MULTISAMPLED
    return textureLoad(scene_depth, at, in.sample);
#else
    return textureLoad(scene_depth, at, 0u);
#endif
}
