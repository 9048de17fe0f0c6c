// Applies the scene's lights and shadows to the color of a pixel. Uses bind group 2 of the passes that show labels.
#define_import_path bevy_plenoctree::shade

#import bevy_plenoctree::edge::neighbor
#import bevy_plenoctree::view::{nearest_drawn, prop_of, screen}

// The settings of a prop that lights fall on.
struct Lit {
    // Transforms a point of the scene to the unit cube, from the box around the prop's leaves.
    box_from_world: mat4x4<f32>,
    // The fraction of light that is missing in full shadow.
    shadows: f32,
    // The fraction of the lights' color that the prop takes on.
    tint: f32,
    // The number of steps to full shadow, or 0 if no lights fall on the prop.
    bands: u32,
    // The distance from which parts of the prop cast shadows on it, in world units.
    self_shadow_distance: f32,
    // The fraction of its own light that full light adds. If it is 0, lights add nothing.
    brightness: f32,
    // How much light from beside and from behind adds at its outline.
    rim: f32,
    // The distance within which its surface is smoothed, in world units.
    radius: f32,
    // Where its shades begin in `shades`, and the number of labels.
    first_shade: u32,
    labels: u32,
}

// Light that is added (up to 1) or missing (down to -1), in the bytes of the lighting pass: 0, and the steps to 1.
const LIGHT_ZERO: f32 = 128.0;
const LIGHT_STEPS: f32 = 127.0;

// The light in a pixel: on one side of a line between two bands, and on the other side, which is one band brighter and
// covers `share` of the pixel.
struct Light {
    // The index of the prop on which it falls.
    prop: u32,
    // The bands from the prop's own light to it, up or down.
    band: i32,
    share: f32,
}

const FULL_LIGHT: Light = Light(0u, 0, 0.0);

// One per prop of the view.
@group(2) @binding(0) var<storage, read> lit: array<Lit>;
// The result of the lighting pass: the color of the light that arrives, and the fraction that is blocked. With
// BRIGHTNESS, that of the smooth_light pass: props that lights brighten have the light that is added or missing instead.
@group(2) @binding(1) var light: texture_2d<f32>;
@group(2) @binding(2) var owner: texture_2d<f32>;
// What each label shows in each band of a prop, from the darkest to the brightest one, in encoded sRGB. See
// `src/render/shades.rs`.
@group(2) @binding(3) var<storage, read> shades: array<vec4<f32>>;

// The effect of lights and shadows on a prop in a pixel.
struct Shade {
    light: Light,
    // The factors of linear light, from the color of the lights.
    tint: vec3<f32>,
}

// Returns 1 + the index of the prop that owns a pixel, posterized or as trained, or 0.
fn lit_prop(pixel: vec2<u32>) -> u32 {
    return prop_of(textureLoad(owner, pixel, 0));
}

// Returns what the lighting pass has found for a prop in a pixel that it owns or, at its edge, in a neighbor that it
// owns.
fn arriving(pixel: vec2<u32>, prop: u32) -> vec4<f32> {
    var at = pixel;
    for (var i = 0; i < 8; i++) {
        if lit_prop(at) == prop + 1u {
            break;
        }
        at = vec2<u32>(nearest_drawn(neighbor(vec2<i32>(pixel), i)));
    }
    return textureLoad(light, at, 0);
}

// Returns whether lights may make a prop brighter.
fn is_brightened(prop: u32) -> bool {
#ifdef BRIGHTNESS
    return lit[prop].brightness > 0.0;
#else
    return false;
#endif
}

// Returns the factors of linear light from the color of the lights that arrive.
fn tint_of(prop: u32, arrives: vec4<f32>) -> vec3<f32> {
    return mix(vec3(1.0), arrives.rgb, lit[prop].tint);
}

// Less of the other band does not show. Covers the rounding of half floats.
const LEAST_SHARE: f32 = 0.02;

// Returns the effect of lights on a prop in a pixel, rounded to bands.
fn shade_of(pixel: vec2<u32>, prop: u32) -> Shade {
    let arrives = arriving(pixel, prop);
    let scaled = f32(max(lit[prop].bands, 1u)) * arrives.a;
    if !is_brightened(prop) {
        return Shade(Light(prop, -i32(floor(scaled + 0.5)), 0.0), tint_of(prop, arrives));
    }
    let low = floor(scaled + LEAST_SHARE);
    let share = select(0.0, scaled - low, scaled - low > LEAST_SHARE);
    return Shade(Light(prop, i32(low), share), tint_of(prop, arrives));
}

// Returns the effect of lights on the posterized owner of a pixel, 1 + its index. Where that is the view, lights fall on
// props as trained.
fn shade_of_owner(pixel: vec2<u32>, owner: u32) -> Shade {
#ifdef LIGHTING
    let prop = select(owner, lit_prop(pixel), owner == screen.view_posterize);
    if prop > 0u {
        return shade_of(pixel, prop - 1u);
    }
#endif
    return Shade(FULL_LIGHT, vec3(1.0));
}

// Returns the factors of linear light of a prop in a pixel that is not posterized.
fn smooth_shade_of(pixel: vec2<u32>, prop: u32) -> vec3<f32> {
    let arrives = arriving(pixel, prop);
    let added = select(-arrives.a, arrives.a, is_brightened(prop));
    let factor = 1.0 + added * select(lit[prop].brightness, lit[prop].shadows, added < 0.0);
    return tint_of(prop, arrives) * factor;
}

// Returns what the label with an index shows in a band, in encoded sRGB.
fn shade_in(prop: u32, band: i32, label: u32) -> vec3<f32> {
    let bands = i32(lit[prop].bands);
    return shades[lit[prop].first_shade + u32(clamp(band, -bands, bands) + bands) * lit[prop].labels + label].rgb;
}
