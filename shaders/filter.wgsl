// One direction of the bilateral filter. See section 4 of the method, step 2.

#import bevy_plenoctree::filter_texel::{pack, pack_filtered, unpack}
#import bevy_plenoctree::view::{filters, nearest_drawn}

@group(1) @binding(0) var source: texture_2d<u32>;

#ifdef HORIZONTAL
const ALONG: vec2<i32> = vec2(1, 0);
#else
const ALONG: vec2<i32> = vec2(0, 1);
#endif

// The weighted sum of colors, and the sum of their weights.
struct Sum {
    color: vec3<f32>,
    weight: f32,
}

@fragment
fn fragment(
    @builtin(position) position: vec4<f32>,
    // The number of previous iterations.
    @location(0) @interpolate(flat) iteration: u32,
) -> @location(0) vec4<u32> {
    let at = vec2<i32>(position.xy);
    let texel = textureLoad(source, at, 0);
    let center = unpack(texel);
    let prop = max(center.owner, 1u) - 1u;
    // Once the first pass has copied them, both textures hold the pixels without an owner.
    let is_kept = center.owner == 0u || iteration >= filters[prop].iterations;
    // What is behind a prop, or beside it, would give its edges tones that are not its own.
    let only = select(0u, center.owner, filters[prop].is_of_tones == 1u);
    let taps = select(filters[prop].taps, 0, is_kept);
    let spacing = filters[prop].spacing;
    let spatial = filters[prop].spatial_falloff;
    let range = filters[prop].range_falloff;
    var sum = Sum(center.color, 1.0);
    for (var tap = 1; tap <= taps; tap++) {
        let offset = i32(f32(tap) * spacing + 0.5);
        let closeness = -f32(offset * offset) * spatial;
        add(&sum, at - offset * ALONG, center.place, only, closeness, range);
        add(&sum, at + offset * ALONG, center.place, only, closeness, range);
    }
    let color = sum.color / sum.weight;
#ifdef LAST
    return pack_filtered(select(color, center.color, is_kept), center.owner);
#else
    return select(pack(color, center.owner), texel, is_kept);
#endif
}

// `only` is the owner of pixels that count, or 0 if all do.
fn add(sum: ptr<function, Sum>, at: vec2<i32>, lab: vec3<f32>, only: u32, closeness: f32, range: f32) {
    // Taps outside the viewport have no weight.
    let inside = nearest_drawn(at);
    let pixel = unpack(textureLoad(source, inside, 0));
    let difference = pixel.place - lab;
    let counts = all(inside == at) && (only == 0u || pixel.owner == only);
    let weight = select(0.0, exp(closeness - dot(difference, difference) * range), counts);
    (*sum).color += weight * pixel.color;
    (*sum).weight += weight;
}
