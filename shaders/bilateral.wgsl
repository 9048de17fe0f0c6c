// One direction of the bilateral filter: section 4, step 2 of the method.

#import bevy_plenoctree::color::{cielab, to_half}
#import bevy_plenoctree::view::{props, view}

@group(1) @binding(0) var source: texture_2d<f32>;
// How many iterations came before.
@group(1) @binding(1) var<uniform> iteration: vec4<u32>;

#ifdef HORIZONTAL
const ALONG: vec2<i32> = vec2(1, 0);
#else
const ALONG: vec2<i32> = vec2(0, 1);
#endif

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let center = textureLoad(source, pixel, 0);
    if center.a == 0.0 {
        discard;
    }
    let prop = u32(center.a) - 1u;
    if iteration.x >= props[prop].iterations {
        return center;
    }
    let lab = cielab(center.rgb);
    var sum = center.rgb;
    var total = 1.0;
    let radius = props[prop].radius;
    for (var offset = -radius; offset <= radius; offset++) {
        let at = pixel + offset * ALONG;
        if offset != 0 && all(at >= vec2(0)) && all(at < vec2<i32>(view.size)) {
            let tap = textureLoad(source, at, 0).rgb;
            let difference = cielab(tap) - lab;
            let weight = exp(-f32(offset * offset) * props[prop].spatial_falloff
                - dot(difference, difference) * props[prop].range_falloff);
            sum += weight * tap;
            total += weight;
        }
    }
    return to_half(vec4(sum / total, center.a));
}
