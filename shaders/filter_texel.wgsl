// A pixel of the bilateral filter's textures. It is a single texel of four words, because loads dominate the cost of a
// tap.
#define_import_path bevy_plenoctree::filter_texel

#import bevy_plenoctree::color::{cielab, to_half}

struct Pixel {
    // Encoded sRGB, stored as half floats.
    color: vec3<f32>,
    // 1 + the index in `props` of the pixel's owner, or 0.
    owner: u32,
    // The color in CIELAB if it will be filtered, computed once per pixel instead of once per tap. From -1024 to 1024,
    // in steps of 1/1024.
    lab: vec3<f32>,
}

const LAB_STEPS: f32 = 1024.0;
const LAB_RANGE: f32 = 1024.0;

fn pack(color: vec3<f32>, owner: u32) -> vec4<u32> {
    let half = to_half(vec4(color, 0.0)).rgb;
#ifdef UNFILTERED
    let lab = vec3(0u);
#else
    let lab = vec3<u32>((clamp(cielab(half), vec3(-LAB_RANGE), vec3(LAB_RANGE - 1.0)) + LAB_RANGE) * LAB_STEPS + 0.5);
#endif
    return vec4(
        pack2x16float(half.rg),
        (pack2x16float(vec2(half.b, 0.0)) & 0xffffu) | (owner << 16u),
        lab.x | (lab.y << 21u),
        (lab.y >> 11u) | (lab.z << 10u),
    );
}

fn unpack(texel: vec4<u32>) -> Pixel {
    let lab = vec3(texel.z & 0x1fffffu, (texel.z >> 21u) | ((texel.w & 0x3ffu) << 11u), texel.w >> 10u);
    return Pixel(
        vec3(unpack2x16float(texel.x), unpack2x16float(texel.y).x),
        texel.y >> 16u,
        vec3<f32>(lab) / LAB_STEPS - LAB_RANGE,
    );
}
