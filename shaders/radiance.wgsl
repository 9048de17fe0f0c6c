// Radiance of a leaf: section 1 of the method. WORDS is the number of words that a channel's coefficients take, two half
// floats each.
#define_import_path bevy_plenoctree::radiance

#import bevy_plenoctree::octree::field

// A field that is larger than one binding lies in several, `field.leaves_per_part` leaves in each.
@group(1) @binding(3) var<storage, read> coefficients: array<u32>;
#ifdef PARTS_2
@group(1) @binding(4) var<storage, read> coefficients_1: array<u32>;
#endif
#ifdef PARTS_3
@group(1) @binding(5) var<storage, read> coefficients_2: array<u32>;
#endif
#ifdef PARTS_4
@group(1) @binding(6) var<storage, read> coefficients_3: array<u32>;
#endif

// Two coefficients.
fn pair(part: u32, index: u32) -> vec2<f32> {
#ifdef PARTS_4
    if part == 3u {
        return unpack2x16float(coefficients_3[index]);
    }
#endif
#ifdef PARTS_3
    if part == 2u {
        return unpack2x16float(coefficients_2[index]);
    }
#endif
#ifdef PARTS_2
    if part == 1u {
        return unpack2x16float(coefficients_1[index]);
    }
#endif
    return unpack2x16float(coefficients[index]);
}

// The basis in one direction, in the pairs in which coefficients are stored.
struct Harmonics {
    y: array<vec2<f32>, #{WORDS}>,
}

// `d` is a unit vector from the eye into the scene, in the field's frame.
fn harmonics(d: vec3<f32>) -> Harmonics {
    var h: Harmonics;
#ifdef RGBA
    h.y[0] = vec2(1.0, 0.0);
#else
    let xx = d.x * d.x;
    let yy = d.y * d.y;
    let zz = d.z * d.z;
    let xy = d.x * d.y;
    let yz = d.y * d.z;
    let xz = d.x * d.z;
    h.y[0] = vec2(0.28209479177387814, 0.0);
#ifdef DEGREE_1
    h.y[0].y = -0.4886025119029199 * d.y;
    h.y[1] = vec2(0.4886025119029199 * d.z, -0.4886025119029199 * d.x);
#endif
#ifdef DEGREE_2
    h.y[2] = vec2(1.0925484305920792 * xy, -1.0925484305920792 * yz);
    h.y[3] = vec2(0.31539156525252005 * (2.0 * zz - xx - yy), -1.0925484305920792 * xz);
    h.y[4] = vec2(0.5462742152960396 * (xx - yy), 0.0);
#endif
#ifdef DEGREE_3
    h.y[4].y = -0.5900435899266435 * d.y * (3.0 * xx - yy);
    h.y[5] = vec2(2.890611442640554 * xy * d.z, -0.4570457994644658 * d.y * (4.0 * zz - xx - yy));
    h.y[6] = vec2(
        0.3731763325901154 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
        -0.4570457994644658 * d.x * (4.0 * zz - xx - yy),
    );
    h.y[7] = vec2(1.445305721320277 * d.z * (xx - yy), -0.5900435899266435 * d.x * (xx - 3.0 * yy));
#endif
#ifdef DEGREE_4
    h.y[8] = vec2(2.5033429417967046 * xy * (xx - yy), -1.7701307697799304 * yz * (3.0 * xx - yy));
    h.y[9] = vec2(0.9461746957575601 * xy * (7.0 * zz - 1.0), -0.6690465435572892 * yz * (7.0 * zz - 3.0));
    h.y[10] = vec2(0.10578554691520431 * (zz * (35.0 * zz - 30.0) + 3.0), -0.6690465435572892 * xz * (7.0 * zz - 3.0));
    h.y[11] = vec2(0.47308734787878004 * (xx - yy) * (7.0 * zz - 1.0), -1.7701307697799304 * xz * (xx - 3.0 * yy));
    h.y[12] = vec2(0.6258357354491761 * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy)), 0.0);
#endif
#endif
    return h;
}

fn channel(part: u32, first: u32, h: ptr<function, Harmonics>) -> f32 {
    var sum = 0.0;
    for (var word = 0u; word < #{WORDS}u; word++) {
        sum += dot(pair(part, first + word), (*h).y[word]);
    }
    return sum;
}

fn radiance(leaf: u32, h: ptr<function, Harmonics>) -> vec3<f32> {
#ifdef PARTS_2
    let part = leaf / field.leaves_per_part;
    let first = (leaf - part * field.leaves_per_part) * (3u * #{WORDS}u);
#else
    let part = 0u;
    let first = leaf * (3u * #{WORDS}u);
#endif
    let sum = vec3(
        channel(part, first, h),
        channel(part, first + #{WORDS}u, h),
        channel(part, first + 2u * #{WORDS}u, h),
    );
#ifdef SIGMOID
    return 1.0 / (1.0 + exp(-sum));
#else ifdef SHIFTED_RELU
    return max(sum + 0.5, vec3(0.0));
#else
    return sum;
#endif
}
