// The finish pass: smooths the borders between labels, and draws ink. At the edges of props, `blend.wgsl` draws over it.
//
// Borders are smoothed between hard labels inside a prop, and islands of a few pixels removed. This is not part of the
// method, whose labels are those of the centers of pixels. Filtered colors change from pixel to pixel, and a border runs
// where two labels are equally near. Within a pixel it is a straight line, which gives the part of the pixel on either
// side. Only labels of neighbors take part, so that no third label appears where a color changes from one to another.

#import bevy_plenoctree::color::{decode, encode, tinted}
#import bevy_plenoctree::filter_texel::unpack
#import bevy_plenoctree::ink::{ink_at, inked, labels, surface_at}
#import bevy_plenoctree::labels::{MOVED, RAMPS, label_at, place_of, placed, ramp_of, shown_at}
#import bevy_plenoctree::shade::{Light, shade_of_owner}
#import bevy_plenoctree::target::over_scene
#import bevy_plenoctree::view::{labelings, nearest_drawn, props, screen, view}

// The results of the label pass. See `ink.wgsl`, too.
@group(1) @binding(0) var shown: texture_2d<f32>;
@group(1) @binding(1) var filtered: texture_2d<u32>;
// The target, before the result is written to it.
@group(1) @binding(3) var scene: texture_2d<f32>;

// The fewest pixels of a label within the 5 x 5 pixels around one of them that are no island. An island goes to its
// surroundings, unless their colors differ by more than DETAIL: then it is a detail.
const LEAST_PIXELS: u32 = 4u;
const DETAIL: f32 = 0.1;
const AROUND: i32 = 5;
// The bits of the AROUND x AROUND pixels that are not the last of their row.
const NOT_LAST: u32 = 0x7bdefu;
// A seam lies between two labels of other ramps: the way by its color is at most this many times as long as the direct
// one, and leads at most this far aside.
const DETOUR: f32 = 1.2;
const ASIDE: f32 = 0.12;
const NO_LABEL: u32 = 0xffffffffu;

// Returns the label of a pixel, as the label pass writes it, if a prop owns it.
fn label_of(pixel: vec2<i32>, owner: u32) -> u32 {
    let at = nearest_drawn(pixel);
    let texel = textureLoad(labels, at, 0).xy;
    return select(NO_LABEL, texel.x, all(at == pixel) && texel.y == owner && texel.x >= 2u);
}

// Returns whether a pixel is at a border between labels of its owner.
fn is_at_border(pixel: vec2<i32>, own: vec2<u32>) -> bool {
    var differs = false;
    for (var i = 0; i < 9; i++) {
        let there = label_of(pixel + vec2(i % 3 - 1, i / 3 - 1), own.y);
        differs = differs || (there != NO_LABEL && there != own.x);
    }
    return differs;
}

// Returns the part of a pixel on the far side of a line: where a linear function is negative that has a value of at least 0
// at the center, and a gradient per pixel.
fn beyond(value: f32, gradient: vec2<f32>) -> f32 {
    let steep = max(abs(gradient.x), abs(gradient.y));
    let flat = min(abs(gradient.x), abs(gradient.y));
    // The line crosses two opposite sides of the pixel, or cuts off a corner.
    let across = 0.5 - value / max(steep, 1e-20);
    let rest = max(0.5 * (steep + flat) - value, 0.0);
    let corner = rest * rest / max(2.0 * steep * flat, 1e-30);
    return clamp(select(corner, across, 2.0 * value <= steep - flat), 0.0, 0.5);
}

// The labels around a pixel.
struct Around {
    // At most four labels meet in a pixel: its own, and the first others among its neighbors.
    candidates: vec4<u32>,
    is_island: vec4<bool>,
    // Whether it is nowhere wider than a pixel.
    is_line: vec4<bool>,
    // Another label farther away.
    farther: u32,
}

fn labels_around(pixel: vec2<i32>, own: vec2<u32>) -> Around {
    var candidates = vec4(own.x, vec3(NO_LABEL));
    var count = 1u;
    for (var i = 0; i < 9; i++) {
        let there = label_of(pixel + vec2(i % 3 - 1, i / 3 - 1), own.y);
        let is_new = there != NO_LABEL && all(candidates != vec4(there));
        candidates = select(candidates, vec4(there), vec4(is_new) & (vec4(0u, 1u, 2u, 3u) == vec4(count)));
        count += select(0u, 1u, is_new);
    }
    // The pixels of each, a bit for each.
    var pixels = vec4(0u);
    var farther = NO_LABEL;
    for (var i = 0u; i < u32(AROUND * AROUND); i++) {
        let there = label_of(pixel + vec2(i32(i) % AROUND - 2, i32(i) / AROUND - 2), own.y);
        let is_candidate = vec4(there) == candidates;
        pixels |= select(vec4(0u), vec4(1u << i), is_candidate);
        farther = select(farther, there, there != NO_LABEL && !any(is_candidate));
    }
    // Lines do not fill any square of 2 x 2 pixels.
    let squares = pixels & (pixels >> vec4(1u)) & (pixels >> vec4(5u)) & (pixels >> vec4(6u)) & vec4(NOT_LAST);
    return Around(candidates, countOneBits(pixels) < vec4(LEAST_PIXELS), squares == vec4(0u), farther);
}

// The color of a pixel where it is compared with labels, its change to the right and its change down, from a quadratic
// B-spline of the pixels around it. Likewise, how much each candidate is the label there.
struct Spline {
    place: array<vec3<f32>, 3>,
    support: array<vec4<f32>, 3>,
}

fn spline_around(pixel: vec2<i32>, own: vec2<u32>, prop: u32, candidates: vec4<u32>) -> Spline {
    var spline = Spline();
    for (var i = 0; i < 9; i++) {
        let offset = vec2(i % 3 - 1, i / 3 - 1);
        let there = label_of(pixel + offset, own.y);
        let at = select(pixel, pixel + offset, there != NO_LABEL);
        let value = placed(prop, unpack(textureLoad(filtered, at, 0)));
        let weight = select(vec2(0.75), vec2(0.125), offset != vec2(0));
        let slope = 0.5 * vec2<f32>(offset);
        let weights = vec3(weight.x * weight.y, slope.x * weight.y, weight.x * slope.y);
        let is_there = select(vec4(0.0), vec4(1.0), vec4(there) == candidates);
        for (var k = 0; k < 3; k++) {
            spline.place[k] += weights[k] * value;
            spline.support[k] += weights[k] * is_there;
        }
    }
    return spline;
}

// Returns which candidates are seams. Where one material borders on another, colors in between can be nearest to a label
// of a third, which would draw a line. Those of the same two materials smooth the border. `places` are those of the
// candidates and of the label farther away.
fn seams(prop: u32, around: Around, own: u32, places: ptr<function, array<vec3<f32>, 5>>) -> vec4<bool> {
    var ramps: array<u32, 5>;
    for (var c = 0u; c < 5u; c++) {
        ramps[c] = ramp_of(prop, candidate(around, own, c));
    }
    let own_ramps = vec4(ramps[0], ramps[1], ramps[2], ramps[3]);
    let has_third = around.candidates.z != NO_LABEL || around.farther != NO_LABEL;
    var is_seam = vec4(false);
    var apart: array<vec4<f32>, 5>;
    for (var i = 0u; i < select(0u, 5u, has_third); i++) {
        let there = (*places)[i];
        apart[i] = vec4(
            distance(there, (*places)[0]),
            distance(there, (*places)[1]),
            distance(there, (*places)[2]),
            distance(there, (*places)[3]),
        );
        for (var k = 0u; k < i; k++) {
            let direct = apart[i][k];
            let longest = min(DETOUR * direct, sqrt(direct * direct + 4.0 * ASIDE * ASIDE));
            let is_between = apart[i] + apart[k] < vec4(select(0.0, longest, ramps[i] != ramps[k]));
            let is_third = (own_ramps != vec4(ramps[i])) & (own_ramps != vec4(ramps[k])) & (own_ramps < vec4(RAMPS));
            is_seam = is_seam | (around.is_line & is_between & is_third);
        }
    }
    return is_seam;
}

// Returns the index of the label of a candidate, or of the label farther away. Where there is none, that of the pixel's
// `own` label.
fn candidate(around: Around, own: u32, index: u32) -> u32 {
    let label = select(around.farther, around.candidates[min(index, 3u)], index < 4u);
    return select(label, own, label == NO_LABEL) - 2u;
}

// Returns the color of a pixel at a border, in encoded sRGB. `own` is its texel of `labels`, and `light` the light
// in which it is seen.
fn bordered(pixel: vec2<i32>, own: vec2<u32>, prop: u32, light: Light) -> vec3<f32> {
    let around = labels_around(pixel, own);
    let is_label = around.candidates != vec4(NO_LABEL);
    let here = placed(prop, unpack(textureLoad(filtered, pixel, 0)));
    var spline = spline_around(pixel, own, prop, around.candidates);
    var places: array<vec3<f32>, 5>;
    for (var c = 0u; c < 5u; c++) {
        places[c] = place_of(prop, label_at(prop, candidate(around, own.x, c)));
    }
    let is_seam = seams(prop, around, own.x, &places);

    // Only an island or a seam can have another label than that of the label pass.
    var nearest = 0u;
    var least = 1e30;
    for (var c = 0u; c < 4u; c++) {
        let more = select(0.0, DETAIL, around.is_island[c]) + select(0.0, 1e3, is_seam[c]);
        let off = distance(here, places[c]) + more;
        nearest = select(nearest, c, is_label[c] && off < least);
        least = select(least, off, is_label[c] && off < least);
    }
    nearest = select(0u, nearest, around.is_island.x || is_seam.x);
    // The spline loses details that are a pixel wide.
    var is_lost = distance(spline.place[0], here) > 0.5 * DETAIL;
    for (var c = 0u; c < 4u; c++) {
        let is_nearer = distance(spline.place[0], places[c]) < distance(spline.place[0], places[nearest]);
        is_lost = is_lost || (is_label[c] && is_nearer);
    }
    let center = select(spline.place[0], here, is_lost);

    // What keeps labels counts only while they are kept from frame to frame.
    let steadiness = select(0.0, labelings[prop].steadiness, labelings[prop].former.owner > 0u);
    let to = places[nearest];
    var sum = vec3(0.0);
    var rest = 1.0;
    for (var c = 0u; c < 4u; c++) {
        // The difference of the squares of the distances, less what keeps labels.
        let other = places[c];
        let step = MOVED * steadiness * distance(other, to);
        let near = vec3(spline.support[0][c], spline.support[1][c], spline.support[2][c]);
        let kept =
            near - vec3(spline.support[0][nearest], spline.support[1][nearest], spline.support[2][nearest]);
        let value = dot(2.0 * center - other - to, to - other) - step * kept.x;
        let along = 2.0 * vec2(dot(spline.place[1], to - other), dot(spline.place[2], to - other));
        let stays = !is_seam[c] && (!around.is_island[c] || distance(other, to) > DETAIL);
        let share = min(beyond(max(value, 0.0), along - step * kept.yz), rest);
        if is_label[c] && c != nearest && stays && share > 0.0 {
            sum += share * decode(shown_at(prop, around.candidates[c] - 2u, light));
            rest -= share;
        }
    }
    let shown = shown_at(prop, around.candidates[nearest] - 2u, light);
    // To the bit what pixels away from borders show.
    if rest == 1.0 {
        return shown;
    }
    return encode(sum + rest * decode(shown));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let seen = textureLoad(shown, pixel, 0);
    let own = textureLoad(labels, pixel, 0).xy;
    if own.x < 2u {
        return seen;
    }
    let owner = select(own.y, screen.view_posterize, own.y == 0u);
    let prop = owner - 1u;
    var color = seen.rgb;
    let is_rough = labelings[prop].smooth_borders == 1u && is_at_border(vec2<i32>(pixel), own);
    // Few pixels are. A loop that runs once or never costs nothing where it runs for none of a group of pixels, and some
    // rasterizers compute both sides of branches.
    for (var rough = select(0u, 1u, is_rough); rough > 0u; rough--) {
        let shade = shade_of_owner(pixel, owner);
        let border = bordered(vec2<i32>(pixel), own, prop, shade.light);
        color = tinted(border, props[prop].tint * shade.tint);
        // The label pass has done so with its color.
        let opacity = select(seen.a, 1.0, own.y == 0u);
        color = over_scene(color, opacity, scene, pixel + view.corner);
    }
#ifdef INK
    let center = surface_at(vec2<i32>(pixel));
    let part = ink_at(vec2<i32>(pixel), center, seen.a >= 1.0);
    if part > 0.0 {
        color = encode(inked(prop, props[prop].tint, decode(color), part));
    }
#endif
    return vec4(color, seen.a);
}
