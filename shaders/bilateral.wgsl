// One direction of the bilateral filter: section 4, step 2 of the method.

#import bevy_plenoctree::color::{cielab, to_half}
#import bevy_plenoctree::view::{props, view}

@group(1) @binding(0) var source: texture_2d<f32>;
// CIELAB of the source: worked out once a pixel, not once a tap.
@group(1) @binding(1) var source_lab: texture_2d<f32>;
// How many iterations came before.
@group(1) @binding(2) var<uniform> iteration: vec4<u32>;

#ifdef HORIZONTAL
const ALONG: vec2<i32> = vec2(1, 0);
#else
const ALONG: vec2<i32> = vec2(0, 1);
#endif

struct Fragment {
    @location(0) color: vec4<f32>,
    @location(1) lab: vec4<f32>,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<i32>(position.xy);
    let center = textureLoad(source, pixel, 0);
    let lab = textureLoad(source_lab, pixel, 0);
    if center.a == 0.0 {
#ifdef HORIZONTAL
        // Afterwards both pictures hold what is left alone, and it need not be written again.
        if iteration.x == 0u {
            return Fragment(center, lab);
        }
#endif
        discard;
    }
    let prop = u32(center.a) - 1u;
    if iteration.x >= props[prop].iterations {
        return Fragment(center, lab);
    }
    var sum = center.rgb;
    var total = 1.0;
    let radius = props[prop].radius;
    for (var offset = -radius; offset <= radius; offset++) {
        let at = pixel + offset * ALONG;
        if offset != 0 && all(at >= vec2(0)) && all(at < vec2<i32>(view.size)) {
            let difference = textureLoad(source_lab, at, 0).rgb - lab.rgb;
            let weight = exp(-f32(offset * offset) * props[prop].spatial_falloff
                - dot(difference, difference) * props[prop].range_falloff);
            sum += weight * textureLoad(source, at, 0).rgb;
            total += weight;
        }
    }
    let value = to_half(vec4(sum / total, center.a));
    return Fragment(value, vec4(cielab(value.rgb), 0.0));
}
