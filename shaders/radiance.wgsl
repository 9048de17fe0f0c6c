// The radiance of a leaf. See section 1 of the method. The coefficients of a leaf take TEXELS texels: WORDS words per
// channel. With a CODEBOOK, a leaf has one texel of two words: its color, and the numbers of its rows. Rows take TEXELS
// texels of two words per part. `src/gpu/payload.rs` packs them.
#define_import_path bevy_plenoctree::radiance

#import bevy_plenoctree::constants::HARMONICS
#ifdef CODEBOOK
#import bevy_plenoctree::octree::codebook
#endif
#import bevy_plenoctree::octree::{field, place}

@group(1) @binding(4) var coefficients: texture_2d_array<u32>;

fn coefficient_texel(index: u32) -> vec4<u32> {
    let at = place(index, field.coefficient_rows);
    return textureLoad(coefficients, at.xy, at.z, 0);
}

#ifdef CODEBOOK
fn codebook_texel(index: u32) -> vec2<u32> {
    let at = place(index, field.codebook_rows);
    return textureLoad(codebook, at.xy, at.z, 0).xy;
}
#endif

// The values of the basis functions in one direction. Functions that the field does not have are 0.
struct Harmonics {
    y: array<f32, 28>,
}

// Evaluates the basis functions. `d` is a unit vector from the eye into the scene, in the field's frame.
fn harmonics(d: vec3<f32>) -> Harmonics {
    var h: Harmonics;
#ifdef RGBA
    h.y[0] = 1.0;
#else
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    let xy = d.x * d.y;
    let yz = d.y * d.z;
    let xz = d.x * d.z;
    h.y[0] = HARMONICS[0];
#ifdef DEGREE_1
    h.y[1] = HARMONICS[1] * d.y;
    h.y[2] = HARMONICS[2] * d.z;
    h.y[3] = HARMONICS[3] * d.x;
#endif
#ifdef DEGREE_2
    h.y[4] = HARMONICS[4] * xy;
    h.y[5] = HARMONICS[5] * yz;
    h.y[6] = HARMONICS[6] * (2.0 * zz - xx - yy);
    h.y[7] = HARMONICS[7] * xz;
    h.y[8] = HARMONICS[8] * (xx - yy);
#endif
#ifdef DEGREE_3
    h.y[9] = HARMONICS[9] * d.y * (3.0 * xx - yy);
    h.y[10] = HARMONICS[10] * xy * d.z;
    h.y[11] = HARMONICS[11] * d.y * (4.0 * zz - xx - yy);
    h.y[12] = HARMONICS[12] * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
    h.y[13] = HARMONICS[13] * d.x * (4.0 * zz - xx - yy);
    h.y[14] = HARMONICS[14] * d.z * (xx - yy);
    h.y[15] = HARMONICS[15] * d.x * (xx - 3.0 * yy);
#endif
#ifdef DEGREE_4
    h.y[16] = HARMONICS[16] * xy * (xx - yy);
    h.y[17] = HARMONICS[17] * yz * (3.0 * xx - yy);
    h.y[18] = HARMONICS[18] * xy * (7.0 * zz - 1.0);
    h.y[19] = HARMONICS[19] * yz * (7.0 * zz - 3.0);
    h.y[20] = HARMONICS[20] * (zz * (35.0 * zz - 30.0) + 3.0);
    h.y[21] = HARMONICS[21] * xz * (7.0 * zz - 3.0);
    h.y[22] = HARMONICS[22] * (xx - yy) * (7.0 * zz - 1.0);
    h.y[23] = HARMONICS[23] * xz * (xx - 3.0 * yy);
    h.y[24] = HARMONICS[24] * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy));
#endif
#endif
    return h;
}

#ifdef CODEBOOK
#ifdef DEGREE_1
// Returns the sum of all harmonics of a part except the first, relative to the largest coefficient. TEXELS texels
// hold all of them.
fn others(row: u32, h: ptr<function, Harmonics>) -> f32 {
    var sum = 0.0;
    for (var index = 0u; index < #{TEXELS}u; index++) {
        let words = codebook_texel(row + index);
        let w = 8u * index;
        sum += dot(unpack4x8snorm(words.x), vec4((*h).y[w + 1u], (*h).y[w + 2u], (*h).y[w + 3u], (*h).y[w + 4u]));
        sum += dot(unpack4x8snorm(words.y), vec4((*h).y[w + 5u], (*h).y[w + 6u], (*h).y[w + 7u], (*h).y[w + 8u]));
    }
    return sum;
}
#endif

// Returns the sums of the channels' harmonics.
fn sums(index: u32, h: ptr<function, Harmonics>) -> vec3<f32> {
    let leaf = coefficient_texel(index).xy;
    // Luma has 12 bits, and the differences have 10 each.
    let color = bitcast<i32>(leaf.x);
    let steps = vec3((color << 20u) >> 20u, (color << 10u) >> 22u, color >> 22u);
    var yuv = (*h).y[0] * field.color_step * vec3<f32>(steps);
#ifdef DEGREE_1
    let luma = field.luma + (leaf.y & 0xffffu) * #{TEXELS}u;
    let chroma = field.chroma + (leaf.y >> 16u) * 2u * #{TEXELS}u;
    yuv += field.table_scale * vec3(others(luma, h), others(chroma, h), others(chroma + #{TEXELS}u, h));
#endif
    return vec3(yuv.x - yuv.z + yuv.y, yuv.x + yuv.z, yuv.x - yuv.z - yuv.y);
}
#else
struct Leaf {
    texels: array<vec4<u32>, #{TEXELS}>,
}

fn load(leaf: u32) -> Leaf {
    var texels: Leaf;
    for (var index = 0u; index < #{TEXELS}u; index++) {
        texels.texels[index] = coefficient_texel(leaf * #{TEXELS}u + index);
    }
    return texels;
}

fn word(leaf: ptr<function, Leaf>, index: u32) -> u32 {
    return (*leaf).texels[index / 4u][index % 4u];
}

// Returns the sum of a channel's harmonics. WORDS words hold all of its coefficients.
fn channel(leaf: ptr<function, Leaf>, index: u32, h: ptr<function, Harmonics>) -> f32 {
    var sum = 0.0;
    for (var w = 0u; w < #{WORDS}u; w++) {
        let pair = unpack2x16float(word(leaf, index * #{WORDS}u + w));
        sum += pair.x * (*h).y[2u * w] + pair.y * (*h).y[2u * w + 1u];
    }
    return sum;
}

// Returns the sums of the channels' harmonics.
fn sums(index: u32, h: ptr<function, Harmonics>) -> vec3<f32> {
    var leaf = load(index);
    return vec3(channel(&leaf, 0u, h), channel(&leaf, 1u, h), channel(&leaf, 2u, h));
}
#endif

fn radiance(index: u32, h: ptr<function, Harmonics>) -> vec3<f32> {
    let sum = sums(index, h);
#ifdef SIGMOID
    return 1.0 / (1.0 + exp(-sum));
#else ifdef SHIFTED_RELU
    return max(sum + 0.5, vec3(0.0));
#else
    return sum;
#endif
}
