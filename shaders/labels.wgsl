// Finds the label of a color, and the color that it shows. See section 4 of the method, steps 3 to 5.
#define_import_path bevy_plenoctree::labels

#import bevy_plenoctree::color::{decode, encode, tone_space}
#import bevy_plenoctree::filter_texel::{Pixel, TONE}
#import bevy_plenoctree::shade::{Light, shade_in}
#import bevy_plenoctree::view::{OPAQUE, colors, labelings}

// A label: a blend of the palette colors `first` and `second`, where `share` is the weight of `first`.
struct Label {
    first: u32,
    second: u32,
    share: f32,
}

// The part of the steadiness that counts where a border between labels may have moved. See `Posterize::steadiness`.
const MOVED: f32 = 0.5;

// The largest number of ramps. Larger ones than their indices stand for a color each that is in no ramp.
const RAMPS: u32 = 64u;

// The indices of the two nearest labels so far, and the squares of their distances.
struct Nearest {
    labels: vec2<u32>,
    distances: vec2<f32>,
}

// Returns whether the labels of a prop are tones, which are compared with colors in the space in which they are fitted.
// Others are compared in encoded sRGB.
fn are_tones(prop: u32) -> bool {
    return labelings[prop].first_place != labelings[prop].first_color;
}

// Returns how opaque a posterized prop is where it was trained to have an opacity. Tones are shown over what is behind
// them, so that haze and glass stay what they are. Other labels are opaque.
fn shown_opacity(prop: u32, opacity: f32) -> f32 {
    return select(1.0, min(opacity / OPAQUE, 1.0), are_tones(prop));
}

// Returns where the filtered color of a pixel is compared with labels.
fn placed(prop: u32, pixel: Pixel) -> vec3<f32> {
    return select(pixel.color, pixel.place * TONE, are_tones(prop));
}

// Returns where a color, in encoded sRGB, is compared with labels.
fn place_of_color(prop: u32, color: vec3<f32>) -> vec3<f32> {
    return select(color, tone_space(color), are_tones(prop));
}

// Returns the place of a label. See `placed`.
fn place_of(prop: u32, label: Label) -> vec3<f32> {
    return shown(labelings[prop].first_place, label);
}

// Returns the label with an index among all labels of a palette, in the order of equation 7: the palette, whose colors
// are blends with themselves, then the blends of every pair.
fn label_at(prop: u32, index: u32) -> Label {
    let count = labelings[prop].colors;
    let blends = labelings[prop].blend_steps - 1u;
    if index < count {
        return Label(index, index, 1.0);
    }
    var first = 0u;
    var rest = index - count;
    while rest >= (count - first - 1u) * blends && first + 1u < count {
        rest -= (count - first - 1u) * blends;
        first++;
    }
    return Label(first, first + 1u + rest / blends, f32(rest % blends + 1u) / f32(blends + 1u));
}

// Returns the ramp of a label, of which it has most. See `RAMPS` for colors in none.
fn ramp_of(prop: u32, index: u32) -> u32 {
    let label = label_at(prop, index);
    let most = select(label.first, label.second, label.share < 0.5);
    return u32(colors[labelings[prop].first_color + most].a);
}

fn consider(nearest: ptr<function, Nearest>, label: u32, distance: f32) {
    let old = *nearest;
    // Of labels at the same distance, the first one counts. Tones come in another order.
    let comes_first = vec2(label) < old.labels;
    let is_first = distance < old.distances.x || (distance == old.distances.x && comes_first.x);
    let is_second = distance < old.distances.y || (distance == old.distances.y && comes_first.y);
    (*nearest).labels = vec2(
        select(old.labels.x, label, is_first),
        select(select(old.labels.y, label, is_second), old.labels.x, is_first),
    );
    (*nearest).distances = vec2(
        select(old.distances.x, distance, is_first),
        select(select(old.distances.y, distance, is_second), old.distances.x, is_first),
    );
}

// Returns the blend of a label in the colors, or places, that begin at `palette`.
fn shown(palette: u32, label: Label) -> vec3<f32> {
    return mix(colors[palette + label.second].rgb, colors[palette + label.first].rgb, label.share);
}

// Tones of two ramps blend over this part of the softness, so that a recolored ramp does not show in other materials.
// Matches `posterize.rs` of the reference.
const ACROSS_RAMPS: f32 = 0.25;
const FAR: f32 = 1e30;

// The color of a pixel, and the index of its nearest label.
struct Shown {
    color: vec3<f32>,
    label: u32,
}

// Returns the color that the label with an index shows in a light.
fn shown_at(prop: u32, index: u32, light: Light) -> vec3<f32> {
#ifdef LIGHTING
    if light.band != 0 || light.share > 0.0 {
        let color = shade_in(light.prop, light.band, index);
        if light.share == 0.0 {
            return color;
        }
        return encode(mix(decode(color), decode(shade_in(light.prop, light.band + 1, index)), light.share));
    }
#endif
    return shown(labelings[prop].first_color + labelings[prop].colors, label_at(prop, index));
}

// Considers the palette colors as labels, and the blends of every pair.
fn consider_blends(nearest: ptr<function, Nearest>, place: vec3<f32>, prop: u32) {
    let count = labelings[prop].colors;
    let places = labelings[prop].first_place;
    let steps = labelings[prop].blend_steps;
    for (var i = 0u; i < count; i++) {
        let off = place - colors[places + i].rgb;
        consider(nearest, i, dot(off, off));
    }
    // The order is that of `label_at`.
    var index = count;
    for (var i = 0u; i < select(0u, count, steps > 1u); i++) {
        let first = colors[places + i].rgb;
        for (var j = i + 1u; j < count; j++) {
            let second = colors[places + j].rgb;
            for (var k = 1u; k < steps; k++) {
                let share = f32(k) / f32(steps);
                let off = place - mix(second, first, share);
                consider(nearest, index, dot(off, off));
                index++;
            }
        }
    }
}

// Considers tones as labels, which do not blend: those that are nearest in lightness first, until no other one can be near enough.
fn consider_tones(nearest: ptr<function, Nearest>, place: vec3<f32>, prop: u32) {
    let count = labelings[prop].colors;
    let sorted = labelings[prop].first_place + count;
    let is_hard = labelings[prop].softness == 0.0;
    var low = 0u;
    var high = count;
    while low < high {
        let middle = (low + high) / 2u;
        let is_darker = colors[sorted + middle].x < place.x;
        low = select(low, middle + 1u, is_darker);
        high = select(middle, high, is_darker);
    }
    var is_done = false;
    for (var step = 0u; step < count && !is_done; step++) {
        is_done = true;
        // A lighter tone, and a darker one. Less than 0 is more than `count`.
        let sides = vec2(low + step, low - 1u - step);
        for (var side = 0u; side < 2u; side++) {
            let tone = colors[sorted + min(sides[side], count - 1u)];
            let off = place - tone.rgb;
            let least = select((*nearest).distances.y, (*nearest).distances.x, is_hard);
            if sides[side] < count && off.x * off.x <= least {
                consider(nearest, u32(tone.w), dot(off, off));
                is_done = false;
            }
        }
    }
}

// Returns the label that is nearest to a place.
fn assign(place: vec3<f32>, prop: u32, light: Light) -> Shown {
    var nearest = Nearest(vec2(0u), vec2(FAR));
    if are_tones(prop) {
        consider_tones(&nearest, place, prop);
    } else {
        consider_blends(&nearest, place, prop);
    }
    var softness = labelings[prop].softness;
    if softness > 0.0 && are_tones(prop) {
        let ramps = vec2(ramp_of(prop, nearest.labels.x), ramp_of(prop, nearest.labels.y));
        let is_across = ramps.x != ramps.y && all(ramps < vec2(RAMPS));
        softness *= select(1.0, ACROSS_RAMPS, is_across);
    }
    let lead = sqrt(nearest.distances.y) - sqrt(nearest.distances.x);
    let first = shown_at(prop, nearest.labels.x, light);
    // Softness 0 gives a hard edge. A palette of one color has no second label: its distance remains FAR.
    if lead >= softness {
        return Shown(first, nearest.labels.x);
    }
    let step = 0.5 + 0.5 * lead / softness;
    let second = shown_at(prop, nearest.labels.y, light);
    return Shown(mix(second, first, step * step * (3.0 - 2.0 * step)), nearest.labels.x);
}
