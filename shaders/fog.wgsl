// The fog pass: applies the camera's `DistanceFog` to props, as Bevy's materials do. Bind group 0 has the lights and the
// fog, as Bevy's mesh view has them.

#ifdef TONEMAPPED
#import bevy_core_pipeline::tonemapping::tone_mapping
#endif
#import bevy_pbr::mesh_view_bindings::{fog, view}
#import bevy_pbr::pbr_functions::apply_fog
#import bevy_plenoctree::color::{decode, encode, to_half}
#import bevy_plenoctree::edge::{bits_of, parts_of, word_at}
#import bevy_plenoctree::target::light_of
#import bevy_plenoctree::view::{Screen, View, is_solid, unpack_haze}

@group(1) @binding(0) var<uniform> screen: Screen;
// The part of the viewport that is drawn.
@group(1) @binding(1) var<uniform> drawn: View;
// The result of the label pass, or of custom stages.
@group(1) @binding(2) var shown: texture_2d<f32>;
@group(1) @binding(3) var depth: texture_depth_2d;
// The target, before the result is written to it.
@group(1) @binding(4) var scene: texture_2d<f32>;
#ifdef SMOOTH
// The results of the outline pass and of the coverage pass.
@group(1) @binding(5) var outline: texture_2d<u32>;
@group(1) @binding(6) var<storage, read> coverage: array<u32>;
#endif

// Returns the depth of the prop in a pixel: where it is solid, or the middle of its haze. At the edge of a prop, that
// of a neighbor. Returns 0 if there is none.
fn depth_near(pixel: vec2<i32>) -> f32 {
    var found = textureLoad(depth, pixel, 0);
    let last = vec2<i32>(drawn.size) - 1;
    for (var reach = 1; reach <= 2 && found == 0.0; reach++) {
        for (var i = 0; i < 9; i++) {
            let at = clamp(pixel + reach * vec2(i % 3 - 1, i / 3 - 1), vec2(0), last);
            found = max(found, textureLoad(depth, at, 0));
        }
    }
    return select(unpack_haze(found, drawn.props), found, is_solid(found));
}

// Fog is linear in what it is in front of: it adds some light, and lets a share of the rest through.
struct Veil {
    added: vec3<f32>,
    through: vec3<f32>,
}

// Returns the fog in front of a depth.
fn veil_at(depth: f32, at: vec2<f32>) -> Veil {
    let ndc = (2.0 * (at - view.main_pass_viewport.xy) / view.main_pass_viewport.zw - 1.0) * vec2(1.0, -1.0);
    let world = view.world_from_clip * vec4(ndc, depth, 1.0);
    let point = world.xyz / world.w;
    let eye = view.world_position;
    // Light that fog scatters is added, and lets nothing through.
    var dark = fog;
    dark.directional_light_color.a = 0.0;
    let through = apply_fog(dark, vec4(1.0), point, eye, at) - apply_fog(dark, vec4(0.0), point, eye, at);
    return Veil(apply_fog(fog, vec4(0.0), point, eye, at).rgb, through.rgb);
}

#ifdef TONEMAPPED
fn tonemapped(light: vec3<f32>) -> vec3<f32> {
    // Some methods divide by the light.
    return tone_mapping(vec4(max(light, vec3(1e-6)), 1.0), view.color_grading).rgb;
}

// The most light that a color is taken for. Bright colors would glow through thick fog if they were taken for all the
// light that tonemapping shows like them.
const BRIGHTEST: f32 = 4.0;

// Returns the light that tonemapping shows as a color, or almost, if it never shows that color: Broyden's method.
fn light_before_tonemapping(shown: vec3<f32>) -> vec3<f32> {
    // Dark haze before something bright is darker than black.
    var light = max(shown, vec3(0.0));
    var off = tonemapped(light) - shown;
    var nearest = light;
    var least = dot(off, off);
    // How light changes with what is shown.
    var slopes = mat3x3(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for (var i = 0; i < 12 && least > 1e-9; i++) {
        let next = clamp(light - slopes * off, vec3(0.0), min(4.0 * light + 0.25, vec3(BRIGHTEST)));
        let next_off = tonemapped(next) - shown;
        let step = next - light;
        let predicted = slopes * (next_off - off);
        let along = dot(step, predicted);
        if abs(along) > 1e-12 {
            let correction = (step - predicted) / along;
            let row = step * slopes;
            slopes += mat3x3(correction * row.x, correction * row.y, correction * row.z);
        }
        light = next;
        off = next_off;
        if dot(off, off) < least {
            nearest = light;
            least = dot(off, off);
        }
    }
    return nearest;
}
#endif

// Returns what a veil shows of a prop's color.
fn seen_through(veil: Veil, color: vec3<f32>) -> vec3<f32> {
#ifdef TONEMAPPED
    // Materials of cameras without `Hdr` map tones after fog. Props get the same, but keep their color without fog.
    let light = light_before_tonemapping(color);
    return tonemapped(veil.through * light + veil.added) + veil.through * (color - tonemapped(light));
#else
    return veil.through * color + veil.added;
#endif
}

#ifdef SMOOTH
// What is seen in a pixel at a smooth edge besides what its center sees: its depth, and its share.
struct Beside {
    depth: f32,
    share: f32,
}

fn beside(pixel: vec2<i32>, here: f32, is_opaque: bool) -> Beside {
    let owners = textureLoad(outline, pixel, 0).xy;
    if all(owners == vec2(0u)) {
        return Beside(here, 0.0);
    }
    // The depth that differs most.
    var found = here;
    let last = vec2<i32>(drawn.size) - 1;
    for (var i = 0; i < 9; i++) {
        let there = textureLoad(depth, clamp(pixel + vec2(i % 3 - 1, i / 3 - 1), vec2(0), last), 0);
        let is_farther = max(there, here) * min(found, here) > max(found, here) * min(there, here);
        found = select(found, there, is_solid(there) && is_farther);
    }
    let parts = parts_of(owners, bits_of(owners, coverage[word_at(vec2<u32>(pixel), drawn.size.x)]));
    let other = select(0u, parts.other, owners.y > 0u) + select(0u, parts.rest, is_opaque);
    let own = parts.own + select(parts.other, 0u, owners.y > 0u);
    return Beside(found, f32(other) / f32(max(own + other, 1u)));
}
#endif

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let seen = textureLoad(shown, pixel, 0);
    if seen.a <= 0.0 {
        return seen;
    }
    let found = depth_near(pixel);
    if found == 0.0 {
        return seen;
    }
    let at = position.xy + vec2<f32>(drawn.corner);
    var veil = veil_at(found, at);
#ifdef SMOOTH
    let other = beside(pixel, found, seen.a >= 1.0);
    if other.share > 0.0 && other.depth != found {
        let behind = veil_at(other.depth, at);
        veil.added = mix(veil.added, behind.added, other.share);
        veil.through = mix(veil.through, behind.through, other.share);
    }
#endif

    // The scene has its own fog already, so its share of the pixel gets none.
    let light = screen.exposure * decode(seen.rgb);
    let stored = textureLoad(scene, vec2<u32>(pixel) + drawn.corner, 0).rgb;
    let opacity = min(seen.a, 1.0);
    let behind = (1.0 - opacity) * clamp(light_of(stored), vec3(0.0), vec3(65504.0));
    let result = opacity * seen_through(veil, (light - behind) / opacity) + behind;
    return to_half(vec4(encode(max(result, vec3(0.0)) / screen.exposure), seen.a));
}
