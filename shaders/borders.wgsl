// Smooths the borders between hard labels inside a prop, and removes islands of a few pixels. This is not part of the
// method, whose labels are those of the centers of pixels.
//
// Labels are assigned at several places within a pixel, from colors that are interpolated between the centers of the
// filtered pixels around it: the border runs where two labels are equally near. Only labels of neighbors take part, so
// that no third label appears where a color changes from one to another.
#define_import_path bevy_plenoctree::borders

#import bevy_plenoctree::color::{decode, encode}
#import bevy_plenoctree::edge::{RAYS, ray_offset}
#import bevy_plenoctree::filter_texel::unpack
#import bevy_plenoctree::labels::{label_at, place_of, placed, shown_in}
#import bevy_plenoctree::shade::Light
#import bevy_plenoctree::view::{labelings, view}

// The fewest pixels of a label within the 5 x 5 pixels around one of them that are no island.
const LEAST_PIXELS: u32 = 4u;
const AROUND: i32 = 5;
const MOST_CANDIDATES: u32 = 9u;
const NO_LABEL: u32 = 0xffffffffu;

// Returns the label of a pixel, as the label pass writes it, if a prop owns it.
fn label_of(labels: texture_2d<u32>, pixel: vec2<i32>, owner: u32) -> u32 {
    let is_inside = all(pixel >= vec2(0)) && all(pixel < vec2<i32>(view.size));
    let texel = textureLoad(labels, max(pixel, vec2(0)), 0).xy;
    return select(NO_LABEL, texel.x, is_inside && texel.y == owner && texel.x >= 2u);
}

// Returns the weights of a quadratic B-spline at a distance from the center of a pixel, from -0.5 to 0.5.
fn spline(t: f32) -> vec3<f32> {
    return vec3(0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t));
}

// Returns whether a pixel is at a border between labels of its owner.
fn is_at_border(labels: texture_2d<u32>, pixel: vec2<i32>, own: vec2<u32>) -> bool {
    var differs = false;
    for (var i = 0; i < 9; i++) {
        let there = label_of(labels, pixel + vec2(i % 3 - 1, i / 3 - 1), own.y);
        differs = differs || (there != NO_LABEL && there != own.x);
    }
    return differs;
}

// Returns the color of a pixel at a border, in encoded sRGB. `own` is its texel of `labels`, and `light` the light
// in which it is seen.
fn bordered(
    labels: texture_2d<u32>,
    filtered: texture_2d<u32>,
    pixel: vec2<i32>,
    own: vec2<u32>,
    prop: u32,
    light: Light,
) -> vec3<f32> {
    var around: array<u32, 25>;
    for (var i = 0; i < AROUND * AROUND; i++) {
        around[i] = label_of(labels, pixel + vec2(i % AROUND - 2, i / AROUND - 2), own.y);
    }
    var candidates: array<u32, MOST_CANDIDATES>;
    var counts: array<u32, MOST_CANDIDATES>;
    var places: array<vec3<f32>, 9>;
    let here = placed(prop, unpack(textureLoad(filtered, pixel, 0)).color);
    var count = 0u;
    for (var i = 0; i < 9; i++) {
        let offset = vec2(i % 3 - 1, i / 3 - 1);
        let there = around[(offset.y + 2) * AROUND + offset.x + 2];
        places[i] = here;
        if there == NO_LABEL {
            continue;
        }
        places[i] = placed(prop, unpack(textureLoad(filtered, pixel + offset, 0)).color);
        var is_known = false;
        for (var c = 0u; c < count; c++) {
            is_known = is_known || candidates[c] == there;
        }
        var pixels = 0u;
        for (var j = 0; j < AROUND * AROUND; j++) {
            pixels += select(0u, 1u, around[j] == there);
        }
        if !is_known && pixels >= LEAST_PIXELS {
            candidates[count] = there;
            counts[count] = 0u;
            count++;
        }
    }
    if count == 0u {
        return shown_in(prop, label_at(prop, own.x - 2u), light);
    }
    let kept = select(0u, count, labelings[prop].former > 0u);
    let steadiness = labelings[prop].steadiness;
    for (var ray = 0u; ray < RAYS; ray++) {
        let offset = ray_offset(ray);
        let x = spline(offset.x);
        let y = spline(offset.y);
        var place = vec3(0.0);
        // How much each candidate is the label here, which counts only while labels are kept from frame to frame.
        var support: array<f32, MOST_CANDIDATES>;
        for (var i = 0; i < 9; i++) {
            place += x[i % 3] * y[i / 3] * places[i];
            for (var c = 0u; c < kept; c++) {
                let there = around[(i / 3 + 1) * AROUND + i % 3 + 1];
                support[c] += select(0.0, x[i % 3] * y[i / 3], there == candidates[c]);
            }
        }
        var nearest = 0u;
        var least = 1e30;
        for (var c = 0u; c < count; c++) {
            let off = place - place_of(prop, label_at(prop, candidates[c] - 2u));
            let distance = select(dot(off, off), length(off) - steadiness * support[c], kept > 0u);
            nearest = select(nearest, c, distance < least);
            least = min(least, distance);
        }
        counts[nearest]++;
    }
    var sum = vec3(0.0);
    for (var c = 0u; c < count; c++) {
        if counts[c] == RAYS {
            // To the bit what pixels away from borders show.
            return shown_in(prop, label_at(prop, candidates[c] - 2u), light);
        }
        if counts[c] > 0u {
            sum += f32(counts[c]) * decode(shown_in(prop, label_at(prop, candidates[c] - 2u), light));
        }
    }
    return encode(sum / f32(RAYS));
}
