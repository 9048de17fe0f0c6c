// One direction of the bilateral filter: section 4, step 2 of the method.

#import bevy_plenoctree::color::{cielab, to_half}
#import bevy_plenoctree::view::{props, view}

@group(1) @binding(0) var source: texture_2d<f32>;
@group(1) @binding(1) var filtered: texture_storage_2d<rgba16float, write>;
// How many iterations came before.
@group(1) @binding(2) var<uniform> iteration: vec4<u32>;

const TILE: i32 = 16;
// Pixels that a tile reads along the filter's direction.
const SPAN: i32 = TILE + 2 * #{MAX_RADIUS};

struct Tap {
    color: vec3<f32>,
    lab: vec3<f32>,
}

var<workgroup> taps: array<Tap, SPAN * TILE>;
var<workgroup> wanted: atomic<u32>;

// `along` runs in the filter's direction, `across` at right angles to it.
fn to_pixel(along: i32, across: i32) -> vec2<i32> {
#ifdef HORIZONTAL
    return vec2(along, across);
#else
    return vec2(across, along);
#endif
}

fn exists(pixel: vec2<i32>) -> bool {
    return all(pixel >= vec2(0)) && all(pixel < vec2<i32>(view.size));
}

@compute @workgroup_size(16, 16)
fn bilateral(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
) {
#ifdef HORIZONTAL
    let corner = TILE * vec2<i32>(group.xy);
    let place = vec2<i32>(local.xy);
#else
    let corner = TILE * vec2<i32>(group.yx);
    let place = vec2<i32>(local.yx);
#endif
    let pixel = to_pixel(corner.x + place.x, corner.y + place.y);
    var center = vec4(0.0);
    if exists(pixel) {
        center = textureLoad(source, pixel, 0);
    }
    let owned = center.a > 0.0;
    if owned {
        atomicStore(&wanted, 1u);
    }
    workgroupBarrier();
    // Tiles without a posterised prop have nothing to do: both textures hold their picture already.
    if atomicLoad(&wanted) != 0u {
        for (var tap = i32(index); tap < SPAN * TILE; tap += TILE * TILE) {
            let at = to_pixel(corner.x + tap % SPAN - #{MAX_RADIUS}, corner.y + tap / SPAN);
            if exists(at) {
                let color = textureLoad(source, at, 0).rgb;
                taps[tap] = Tap(color, cielab(color));
            }
        }
    }
    workgroupBarrier();
    if !owned {
        return;
    }

    let prop = u32(center.a) - 1u;
    var color = center.rgb;
    if iteration.x < props[prop].iterations {
        let here = place.y * SPAN + place.x + #{MAX_RADIUS};
        let lab = taps[here].lab;
        var sum = vec3(0.0);
        var total = 0.0;
        for (var offset = -props[prop].radius; offset <= props[prop].radius; offset++) {
            if exists(to_pixel(corner.x + place.x + offset, corner.y + place.y)) {
                let tap = taps[here + offset];
                let difference = tap.lab - lab;
                let weight = exp(-f32(offset * offset) * props[prop].spatial_falloff
                    - dot(difference, difference) * props[prop].range_falloff);
                sum += weight * tap.color;
                total += weight;
            }
        }
        color = sum / total;
    }
    textureStore(filtered, pixel, to_half(vec4(color, center.a)));
}
