// What the view's target stores, and what props are made of: encoded sRGB, as displays show it at the default exposure.
#define_import_path bevy_plenoctree::target

#import bevy_plenoctree::color::{decode, encode}
#import bevy_plenoctree::view::view
#ifdef OKLAB_TARGET
#import bevy_render::color_operations::{linear_rgb_to_oklab, oklab_to_linear_rgb}
#endif

fn from_target(stored: vec3<f32>) -> vec3<f32> {
#ifdef SRGB_TARGET
    let light = decode(stored);
#else ifdef OKLAB_TARGET
    let light = oklab_to_linear_rgb(stored);
#else
    let light = stored;
#endif
    // An infinite light behind an opaque prop is no light.
    return encode(clamp(light / view.exposure, vec3(0.0), vec3(65504.0)));
}

fn to_target(color: vec3<f32>) -> vec3<f32> {
    // What half floats hold: infinite light is a hole after bloom.
    let light = clamp(view.exposure * decode(color), vec3(-65504.0), vec3(65504.0));
#ifdef SRGB_TARGET
    return encode(light);
#else ifdef OKLAB_TARGET
    return linear_rgb_to_oklab(max(light, vec3(0.0)));
#else
    return light;
#endif
}
