// A pixel of the bilateral filter's textures. It is a single texel of four words, because loads dominate the cost of a
// tap.
#define_import_path bevy_plenoctree::filter_texel

#import bevy_plenoctree::color::{cielab, to_half, tone_space}

struct Pixel {
    // Encoded sRGB, stored as half floats.
    color: vec3<f32>,
    // 1 + the index in `props` of the pixel's owner, or 0.
    owner: u32,
    // While it is filtered, the color in CIELAB, and then, in the space of tones. It is computed once per pixel instead of
    // once per tap, or once per label. From -RANGE to RANGE, in steps of RANGE / 2^20.
    place: vec3<f32>,
}

// CIELAB is in its own units, and the space of tones in these.
const TONE: f32 = 1.0 / 64.0;
const RANGE: f32 = 1024.0;
const STEPS: f32 = 1048576.0 / RANGE;

fn pack_at(color: vec3<f32>, owner: u32, place: vec3<f32>) -> vec4<u32> {
    let at = vec3<u32>((clamp(place, vec3(-RANGE), vec3(RANGE - 1.0)) + RANGE) * STEPS + 0.5);
    return vec4(
        pack2x16float(color.rg),
        (pack2x16float(vec2(color.b, 0.0)) & 0xffffu) | (owner << 16u),
        at.x | (at.y << 21u),
        (at.y >> 11u) | (at.z << 10u),
    );
}

// Packs a pixel that will be filtered.
fn pack(color: vec3<f32>, owner: u32) -> vec4<u32> {
    let half = to_half(vec4(color, 0.0)).rgb;
    return pack_at(half, owner, cielab(half));
}

// Packs a pixel that is filtered.
fn pack_filtered(color: vec3<f32>, owner: u32) -> vec4<u32> {
    let half = to_half(vec4(color, 0.0)).rgb;
    return pack_at(half, owner, tone_space(half) / TONE);
}

// Packs a pixel without an owner that no other pixel reads.
fn pack_shown(color: vec3<f32>) -> vec4<u32> {
    return pack_at(to_half(vec4(color, 0.0)).rgb, 0u, vec3(0.0));
}

fn unpack(texel: vec4<u32>) -> Pixel {
    let at = vec3(texel.z & 0x1fffffu, (texel.z >> 21u) | ((texel.w & 0x3ffu) << 11u), texel.w >> 10u);
    return Pixel(
        vec3(unpack2x16float(texel.x), unpack2x16float(texel.y).x),
        texel.y >> 16u,
        vec3<f32>(at) / STEPS - RANGE,
    );
}
