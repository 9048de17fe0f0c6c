// The color spaces in which the view's target holds light.
#define_import_path bevy_plenoctree::space

#import bevy_plenoctree::color::{decode, encode}
#ifdef OKLAB_TARGET
#import bevy_render::color_operations::{linear_rgb_to_oklab, oklab_to_linear_rgb}
#endif

// Returns the linear light of what the target holds.
fn light_of(stored: vec3<f32>) -> vec3<f32> {
#ifdef SRGB_TARGET
    return decode(stored);
#else ifdef OKLAB_TARGET
    return oklab_to_linear_rgb(stored);
#else
    return stored;
#endif
}

// Returns what the target holds for linear light.
fn stored_of(light: vec3<f32>) -> vec3<f32> {
#ifdef SRGB_TARGET
    return encode(light);
#else ifdef OKLAB_TARGET
    return linear_rgb_to_oklab(max(light, vec3(0.0)));
#else
    return light;
#endif
}
