// Color conversions. Radiance, palettes and labels are in encoded sRGB, which only the final write to a linear target
// decodes.
#define_import_path bevy_plenoctree::color

#import bevy_render::color_operations::linear_rgb_to_oklab

// Rounds to the nearest half float. Devices may truncate what they store in half-float textures, and a value that is
// truncated in each pass of the filter drifts.
fn to_half(value: vec4<f32>) -> vec4<f32> {
    let held = clamp(value, vec4(-65504.0), vec4(65504.0));
    return bitcast<vec4<f32>>((bitcast<vec4<u32>>(held) + 0x1000u) & vec4(0xffffe000u));
}

fn decode(encoded: vec3<f32>) -> vec3<f32> {
    let low = encoded / 12.92;
    let high = pow(max((encoded + 0.055) / 1.055, vec3(0.0)), vec3(2.4));
    return select(high, low, encoded <= vec3(0.04045));
}

fn encode(linear: vec3<f32>) -> vec3<f32> {
    let low = linear * 12.92;
    let high = 1.055 * pow(max(linear, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055;
    return select(high, low, linear <= vec3(0.0031308));
}

// Multiplies the linear light of a color in encoded sRGB.
fn tinted(encoded: vec3<f32>, tint: vec3<f32>) -> vec3<f32> {
    if all(tint == vec3(1.0)) {
        return encoded;
    }
    return encode(decode(encoded) * tint);
}

// The same for a color that is premultiplied by opacity.
fn premultiplied_tinted(color: vec4<f32>, tint: vec3<f32>) -> vec4<f32> {
    return vec4(color.a * tinted(color.rgb / max(color.a, 1e-6), tint), color.a);
}

fn cielab(encoded: vec3<f32>) -> vec3<f32> {
    let linear = decode(encoded);
    // Each row is divided by its sum, the white point.
    let xyz = vec3(
        dot(linear, vec3(0.4124, 0.3576, 0.1805) / 0.9505),
        dot(linear, vec3(0.2126, 0.7152, 0.0722)),
        dot(linear, vec3(0.0193, 0.1192, 0.9505) / 1.089),
    );
    let edge = 6.0 / 29.0;
    let low = xyz / (3.0 * edge * edge) + 4.0 / 29.0;
    let high = pow(max(xyz, vec3(0.0)), vec3(1.0 / 3.0));
    let f = select(low, high, xyz > vec3(edge * edge * edge));
    return vec3(116.0 * f.y - 16.0, 500.0 * (f.x - f.y), 200.0 * (f.y - f.z));
}

fn oklab(encoded: vec3<f32>) -> vec3<f32> {
    return linear_rgb_to_oklab(max(decode(encoded), vec3(0.0)));
}

// How much more a difference of chroma counts than one of lightness. Matches `plenoctree::palette::tone_space`.
const CHROMA: f32 = 2.0;

// Converts encoded sRGB to the space in which tones are fitted. It holds what displays show.
fn tone_space(encoded: vec3<f32>) -> vec3<f32> {
    return oklab(saturate(encoded)) * vec3(1.0, CHROMA, CHROMA);
}
