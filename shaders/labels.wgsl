// Finds the label of a color, and the color that it shows. See section 4 of the method, steps 3 to 5.
#define_import_path bevy_plenoctree::labels

#import bevy_plenoctree::color::tone_space
#ifdef LIGHTING
#import bevy_plenoctree::color::{decode, encode}
#endif
#import bevy_plenoctree::filter_texel::{Pixel, TONE}
#import bevy_plenoctree::shade::Light
#ifdef LIGHTING
#import bevy_plenoctree::shade::shade_in
#endif
#import bevy_plenoctree::view::{colors, labelings}

// A label: a blend of the palette colors `first` and `second`, where `share` is the weight of `first`.
struct Label {
    first: u32,
    second: u32,
    share: f32,
}

// The two nearest labels so far, as packed by `packed`, and the squares of their distances.
struct Nearest {
    labels: vec2<u32>,
    distances: vec2<f32>,
}

// Packs a label: the palette colors that it blends, and how many of the steps from the second to the first one it
// takes.
fn packed(first: u32, second: u32, step: u32) -> u32 {
    return first | (second << 8u) | (step << 16u);
}

// Returns the label that `packed` packed. A palette color is a blend with itself.
fn unpacked(label: u32, steps: u32) -> Label {
    let first = label & 255u;
    let second = (label >> 8u) & 255u;
    return Label(first, second, select(f32(label >> 16u) / f32(steps), 1.0, first == second));
}

// Returns whether the labels of a prop are tones, which are compared with colors in the space in which they are fitted.
// Others are compared in encoded sRGB.
fn are_tones(prop: u32) -> bool {
    return labelings[prop].first_place != labelings[prop].first_color;
}

// The opacity from which posterized pixels are opaque. Matches `posterize.rs` of the reference.
const OPAQUE: f32 = 0.9;

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
    if are_tones(prop) {
        return tone_space(color);
    }
    return color;
}

// Returns the place of a label. See `placed`.
fn place_of(prop: u32, label: Label) -> vec3<f32> {
    return shown(labelings[prop].first_place, label);
}

// Returns the index of a packed label among all labels of a palette of `count` colors, in the order of equation 7: the
// palette, then the blends of every pair.
fn index_of(label: u32, count: u32, steps: u32) -> u32 {
    let first = label & 255u;
    let second = (label >> 8u) & 255u;
    let pairs = first * (2u * count - first - 1u) / 2u + second - first - 1u;
    return select(count + pairs * (steps - 1u) + (label >> 16u) - 1u, first, first == second);
}

// Returns the label with an index among all labels. See `index_of`.
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

fn consider(nearest: ptr<function, Nearest>, label: u32, distance: f32) {
    let old = *nearest;
    let is_first = distance < old.distances.x;
    let is_second = distance < old.distances.y;
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

const FAR: f32 = 1e30;

// The color of a pixel, and the index of its nearest label.
struct Shown {
    color: vec3<f32>,
    label: u32,
}

// Returns the color that a label shows in a light. `index` is its index among all labels.
fn shown_in(prop: u32, label: Label, index: u32, light: Light) -> vec3<f32> {
#ifdef LIGHTING
    if light.band != 0 || light.share > 0.0 {
        let color = shade_in(light.prop, light.band, index);
        if light.share == 0.0 {
            return color;
        }
        return encode(mix(decode(color), decode(shade_in(light.prop, light.band + 1, index)), light.share));
    }
#endif
    return shown(labelings[prop].first_color + labelings[prop].colors, label);
}

// Returns the color that the label with an index shows in a light.
fn shown_at(prop: u32, index: u32, light: Light) -> vec3<f32> {
    return shown_in(prop, label_at(prop, index), index, light);
}

// Considers the palette colors as labels, and the blends of every pair.
fn consider_blends(nearest: ptr<function, Nearest>, place: vec3<f32>, prop: u32) {
    let count = labelings[prop].colors;
    let places = labelings[prop].first_place;
    let steps = labelings[prop].blend_steps;
    for (var i = 0u; i < count; i++) {
        let off = place - colors[places + i].rgb;
        consider(nearest, packed(i, i, 0u), dot(off, off));
    }
    for (var i = 0u; i < select(0u, count, steps > 1u); i++) {
        let first = colors[places + i].rgb;
        for (var j = i + 1u; j < count; j++) {
            let second = colors[places + j].rgb;
            for (var k = 1u; k < steps; k++) {
                let share = f32(k) / f32(steps);
                let off = place - mix(second, first, share);
                consider(nearest, packed(i, j, k), dot(off, off));
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
                let index = u32(tone.w);
                consider(nearest, packed(index, index, 0u), dot(off, off));
                is_done = false;
            }
        }
    }
}

// Returns the label that is nearest to a place.
fn assign(place: vec3<f32>, prop: u32, light: Light) -> Shown {
    let count = labelings[prop].colors;
    let steps = labelings[prop].blend_steps;
    var nearest = Nearest(vec2(0u), vec2(FAR));
    if are_tones(prop) {
        consider_tones(&nearest, place, prop);
    } else {
        consider_blends(&nearest, place, prop);
    }
    let softness = labelings[prop].softness;
    let lead = sqrt(nearest.distances.y) - sqrt(nearest.distances.x);
    let index = index_of(nearest.labels.x, count, steps);
    let first = shown_in(prop, unpacked(nearest.labels.x, steps), index, light);
    // Softness 0 gives a hard edge. A palette of one color has no second label: its distance remains FAR.
    if lead >= softness {
        return Shown(first, index);
    }
    let step = 0.5 + 0.5 * lead / softness;
    let other = index_of(nearest.labels.y, count, steps);
    let second = shown_in(prop, unpacked(nearest.labels.y, steps), other, light);
    return Shown(mix(second, first, step * step * (3.0 - 2.0 * step)), index);
}
