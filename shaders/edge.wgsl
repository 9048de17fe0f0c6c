// What the passes that smooth edges share: the neighbors of a pixel, and the parts into which rays divide it.
#define_import_path bevy_plenoctree::edge

// The number of rays through a pixel.
const RAYS: u32 = 8u;

// Returns one of the eight neighbors of a pixel. The first four share a side with it.
fn neighbor(pixel: vec2<i32>, index: i32) -> vec2<i32> {
    let along = 2 * (index & 1) - 1;
    let across = (index & 2) - 1;
    let beside = select(vec2(along, 0), vec2(0, along), across > 0);
    return pixel + select(beside, vec2(along, across), index > 3);
}

// Returns where a ray crosses its pixel, relative to the center. No two rays share a row or a column of sixteenths, so
// that edges of every slope are smooth. These are the places of samples with Direct3D's 8 samples per pixel.
fn ray_offset(ray: u32) -> vec2<f32> {
    let place = vec2(0xfb135d79u, 0x1f7d39b5u) >> vec2(4u * ray);
    return (vec2<f32>(place & vec2(15u)) - 8.0) / 16.0;
}

// Returns the sample of the scene that is nearest to a ray. Every sample is nearest to equally many rays.
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
