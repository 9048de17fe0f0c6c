// Shared by the passes that smooth edges: the neighbors of a pixel, and the parts into which rays divide it.
#define_import_path bevy_plenoctree::edge

// The number of rays through a pixel.
const RAYS: u32 = 8u;
// Where less light comes through, it does not show. Rays stop there, unless they do not count as covered yet.
const FAINTEST: f32 = 0.08;

// What the mask of edges holds where props are, and at their edges. It is 0 elsewhere. The depth test of passes compares
// with it: these are integers in its 16 bits.
const MASK_OF_PROPS: f32 = 0.2;
const MASK_OF_EDGES: f32 = 1.0;

const ALL_SAMPLES: u32 = 0xffffffffu;

// Returns one of the eight neighbors of a pixel. The first four share a side with it.
fn neighbor(pixel: vec2<i32>, index: i32) -> vec2<i32> {
    let along = 2 * (index & 1) - 1;
    let across = (index & 2) - 1;
    let beside = select(vec2(along, 0), vec2(0, along), across > 0);
    return pixel + select(beside, vec2(along, across), index > 3);
}

// Returns where a ray crosses its pixel, relative to the center. No two rays share a row or a column of sixteenths, so
// that edges of every slope are smooth. These are the positions of Direct3D's standard pattern of 8 samples.
fn ray_offset(ray: u32) -> vec2<f32> {
    let place = vec2(0xfb135d79u, 0x1f7d39b5u) >> vec2(4u * ray);
    return (vec2<f32>(place & vec2(15u)) - 8.0) / 16.0;
}

// Returns where one of four rays crosses its pixel: the corners of a square that is turned, so that their rows and
// columns are a quarter of a pixel apart.
fn offset_of_four(ray: u32) -> vec2<f32> {
    let place = vec2(0x26eau, 0x6ea2u) >> vec2(4u * ray);
    return (vec2<f32>(place & vec2(15u)) - 8.0) / 16.0;
}

// Returns the sample of the scene that is nearest to a ray. Every sample is nearest to the same number of rays.
fn sample_of(ray: u32, samples: u32) -> u32 {
    var table = 0u;
    if samples == 2u {
        table = 0x10101001u;
    } else if samples == 4u {
        table = 0x13220130u;
    } else if samples == 8u {
        table = 0x76543210u;
    }
    return (table >> (4u * ray)) & 15u;
}

// Returns the bits of the rays to which a sample of the scene is nearest.
fn rays_of(sample: u32, samples: u32) -> u32 {
    var rays = 0u;
    for (var ray = 0u; ray < RAYS; ray++) {
        rays |= select(0u, 1u << ray, sample_of(ray, samples) == sample);
    }
    return rays;
}

// Returns the bits of a pixel's rays, as in `coverage.wgsl`, from the word that holds them. Away from edges, it may hold
// anything.
fn bits_of(owners: vec2<u32>, word: u32) -> vec4<u32> {
    return select(vec4(0u), (vec4(word) >> vec4(0u, 8u, 16u, 24u)) & vec4(255u), any(owners > vec2(0u)));
}

fn word_of(bits: vec4<u32>) -> u32 {
    return bits.r | (bits.g << 8u) | (bits.b << 16u) | (bits.a << 24u);
}

fn word_at(pixel: vec2<u32>, width: u32) -> u32 {
    return pixel.y * width + pixel.x;
}

// Where the center of a pixel and the rays that are not covered see a thin part of a prop, returns how to replace the
// color of the center with that of the rays: multiply by the last channel, then add the color, in encoded sRGB.
fn thinned(center: vec4<f32>, rays: vec4<f32>) -> vec4<f32> {
    let factor = (1.0 - rays.a) / max(1.0 - center.a, 1e-2);
    return vec4(rays.rgb - factor * center.rgb, factor);
}

// The parts of a pixel at the edge of a prop.
struct Parts {
    // The numbers of rays that show the owner of the pixel, the other one, and what is behind both. If there is no
    // other owner, `other` is the second color of the first one. See `coverage.wgsl`.
    own: u32,
    other: u32,
    rest: u32,
    // Whether the center shows what is behind.
    is_center: bool,
    // The samples of the target to write.
    written: u32,
}

// Returns the parts of a pixel from the results of the outline pass and of the coverage pass. With TARGET_SAMPLES, the
// target has the samples of the scene, and those in front of the owners keep their color.
fn parts_of(owners: vec2<u32>, bits: vec4<u32>) -> Parts {
    // If the pixel has no owner, its center stands for everything that the other one does not cover.
    let has_own = owners.x > 0u;
    let own = countOneBits(select(0u, bits.r & ~bits.g, has_own));
    let other = countOneBits(select(bits.g, bits.g | (bits.b & ~bits.r), has_own));
#ifdef TARGET_SAMPLES
    let rays = RAYS - countOneBits(bits.a) * RAYS / #{TARGET_SAMPLES}u;
    let written = ~bits.a;
    let is_center = !has_own;
#else
    let rays = RAYS;
    let written = ALL_SAMPLES;
    // At the edge of a mesh, the scene's color mixes several objects.
    let is_center = !has_own && bits.a == 0u;
#endif
    return Parts(
        own,
        other,
        rays - min(own + other, rays),
        is_center,
        select(written, ALL_SAMPLES, is_center && own + other == 0u),
    );
}
