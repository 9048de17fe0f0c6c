// Conversions between the color space in which the view's target holds light and that of props: encoded sRGB, as
// displays show it at the default exposure.
#define_import_path bevy_plenoctree::target

#import bevy_plenoctree::color::{decode, encode}
#import bevy_plenoctree::view::screen
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

fn from_target(stored: vec3<f32>) -> vec3<f32> {
    // Clamp: behind an opaque prop, infinite light times zero would be NaN.
    return encode(clamp(light_of(stored) / screen.exposure, vec3(0.0), vec3(65504.0)));
}

// Returns what the layer shows over the scene, in encoded sRGB. `over` is the layer's color, and `stored` the target's.
fn composited(over: vec4<f32>, stored: vec3<f32>) -> vec3<f32> {
    return over.rgb + (1.0 - over.a) * from_target(stored);
}

// Returns a color over a pixel of the scene, in encoded sRGB.
fn over_scene(color: vec3<f32>, opacity: f32, scene: texture_2d<f32>, pixel: vec2<u32>) -> vec3<f32> {
    if opacity == 1.0 {
        return color;
    }
    return mix(from_target(textureLoad(scene, pixel, 0).rgb), color, opacity);
}

fn to_target(color: vec3<f32>) -> vec3<f32> {
    // Clamp to the range of half floats: bloom would turn infinite light into a hole.
    return stored_of(clamp(screen.exposure * decode(color), vec3(-65504.0), vec3(65504.0)));
}
