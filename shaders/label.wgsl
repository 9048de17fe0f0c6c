// The label pass: assigns labels where pixels are posterized, and shows the composite elsewhere. See section 4 of the
// method, steps 1 and 3 to 5.

#import bevy_plenoctree::color::{premultiplied_tinted, tinted, to_half}
#import bevy_plenoctree::filter_texel::unpack
#import bevy_plenoctree::labels::{MOVED, Shown, assign, label_at, place_of, placed, shown_at, shown_opacity}
#import bevy_plenoctree::recolor::recolored_in_tint
#import bevy_plenoctree::shade::{Light, lit_prop, shade_of_owner, smooth_shade_of}
#import bevy_plenoctree::target::{composited, over_scene}
#import bevy_plenoctree::view::{distance_from_depth, haze_prop, is_solid, labelings, length_at, props, screen, view}

@group(1) @binding(1) var layer: texture_2d<f32>;
#ifdef UNPOSTERIZED
@group(1) @binding(0) var scene: texture_2d<f32>;
#else
@group(1) @binding(0) var filtered: texture_2d<u32>;
@group(1) @binding(2) var depth: texture_depth_2d;
// The target, before the result is written to it.
@group(1) @binding(3) var scene: texture_2d<f32>;
#endif
#ifdef STEADY
// The results of the former frame.
@group(1) @binding(4) var labels_before: texture_2d<u32>;
@group(1) @binding(5) var depth_before: texture_depth_2d;

// Keeps labels while something moves, so that they do not flicker. See `Posterize::steadiness`.

// The largest difference of distances at which two frames see the same part of a prop, relative to the distance or, with
// parallel rays, to the height of the view.
const SAME: f32 = 0.01;

// The labels of the former frame around a point of a prop, plus 2, or 0 where it saw something else: of four pixels with
// their bilinear weights, and if none of them had the label that the point has now, of five others around the nearest one.
struct Former {
    labels: array<u32, 9>,
    weights: vec4<f32>,
}

// Returns the label of the former frame in a pixel, plus 2, or 0 if it did not see the part of the prop at a depth.
fn former_label(prop: u32, pixel: vec2<f32>, depth: f32) -> u32 {
    let at = vec2<u32>(max(pixel, vec2(0.0)));
    let texel = textureLoad(labels_before, at, 0).xy;
    let solid = textureLoad(depth_before, at, 0);
    let distance = distance_from_depth(solid);
    let is_same = is_solid(solid) && abs(distance_from_depth(depth) - distance) < SAME * length_at(distance);
    return select(0u, texel.x, is_same && texel.y == labelings[prop].former.owner);
}

// `at` is the place of the point, in pixels, and `label` is the label that it has now.
fn former_labels(prop: u32, at: vec2<f32>, depth: f32, label: u32) -> Former {
    var found = Former();
    if labelings[prop].former.owner == 0u || !is_solid(depth) {
        return found;
    }
    let now = vec4((2.0 * at / vec2<f32>(view.size) - 1.0) * vec2(1.0, -1.0), depth, 1.0);
    let clip = labelings[prop].former.from_clip * now;
    let before = clip.xyz / clip.w;
    let size = labelings[prop].former.size;
    let place = (0.5 + 0.5 * before.xy * vec2(1.0, -1.0)) * size - 0.5;
    if clip.w <= 0.0 || any(place < vec2(0.0)) || any(place >= size - 1.0) {
        return found;
    }
    let corner = floor(place);
    var is_new = true;
    for (var i = 0; i < 4; i++) {
        let there = corner + vec2(f32(i & 1), f32(i >> 1));
        found.labels[i] = former_label(prop, there, before.z);
        is_new = is_new && found.labels[i] != label + 2u;
    }
    let after = place - corner;
    let here = 1.0 - after;
    found.weights = vec4(here.x, after.x, here.x, after.x) * vec4(here.yy, after.yy);
    // The others have no weight, and only say whether the label is new around the point.
    let aside = corner + select(vec2(-1.0), vec2(2.0), place - corner >= vec2(0.5));
    let first = min(corner.x, aside.x);
    for (var i = 4; i < select(4, 9, is_new); i++) {
        let of_row = vec2(first + f32(i - 4), aside.y);
        let of_column = vec2(aside.x, corner.y + f32(i - 7));
        found.labels[i] = former_label(prop, select(of_column, of_row, i < 7), before.z);
    }
    return found;
}

// Returns the share of the bilinear weights that a label has.
fn support(former: Former, label: u32) -> f32 {
    var sum = 0.0;
    for (var i = 0; i < 4; i++) {
        sum += select(0.0, former.weights[i], former.labels[i] == label + 2u);
    }
    return sum;
}

// Returns the label that is nearest to a place, if those count as nearer that the former frame had there: by all of the
// steadiness where it had the nearest label nowhere around, and otherwise, where a border has moved, by a part of it.
fn steadied(nearest: Shown, place: vec3<f32>, prop: u32, light: Light, former: Former) -> Shown {
    var is_new = true;
    var others = 0u;
    for (var i = 0; i < 9; i++) {
        let is_other = former.labels[i] != nearest.label + 2u;
        is_new = is_new && is_other;
        others += select(0u, 1u, is_other && former.labels[i] >= 2u);
    }
    // The former frame knew no other label around the point, as for most pixels.
    if others == 0u {
        return nearest;
    }
    let steadiness = labelings[prop].steadiness;
    var best = nearest.label;
    var least = distance(place, place_of(prop, label_at(prop, best))) - MOVED * steadiness * support(former, best);
    for (var i = 0; i < 9; i++) {
        let label = max(former.labels[i], 2u) - 2u;
        if former.labels[i] >= 2u && label != nearest.label {
            let nearer = steadiness * select(MOVED * support(former, label), 1.0, is_new);
            let off = distance(place, place_of(prop, label_at(prop, label))) - nearer;
            best = select(best, label, off < least);
            least = min(least, off);
        }
    }
    if best == nearest.label {
        return nearest;
    }
    return Shown(shown_at(prop, best, light), best);
}
#endif

// What a pixel shows: its color in encoded sRGB and its opacity, and what `LabelStages` says about it.
struct Seen {
    color: vec3<f32>,
    alpha: f32,
    label: u32,
    owner: u32,
}

#ifndef UNPOSTERIZED
// Returns how much the color of a thin pixel of a posterized prop changes: the prop that is drawn last there, or where
// that one is solid, the only one of the view. The volume pass recolors props as trained.
fn moved(pixel: vec2<u32>, over: vec4<f32>) -> vec3<f32> {
    let found = textureLoad(depth, pixel, 0);
    let prop = select(haze_prop(found, view.props), 0u, is_solid(found));
    let is_known = !is_solid(found) || view.props == 1u;
    if over.a <= 0.0 || !is_known || props[prop].posterized == 0u || labelings[prop].recolors == 0u {
        return vec3(0.0);
    }
    let own = over.rgb / over.a;
    return over.a * (recolored_in_tint(prop, own) - own);
}
#endif

// Returns what a pixel shows that is not posterized, from the layer and from the composite.
fn as_trained(pixel: vec2<u32>, over: vec4<f32>, composite: vec3<f32>) -> Seen {
    var color = composite;
#ifdef LIGHTING
    let trained = lit_prop(pixel);
    if trained > 0u && over.a > 0.0 {
        // What shows through the prop keeps its light.
        color += premultiplied_tinted(over, smooth_shade_of(pixel, trained - 1u)).rgb - over.rgb;
    }
#endif
    return Seen(color, over.a, select(0u, 1u, over.a > 0.0), 0u);
}

fn seen_at(pixel: vec2<u32>) -> Seen {
    let over = textureLoad(layer, pixel, 0);
#ifdef UNPOSTERIZED
    let composite = composited(over, textureLoad(scene, pixel + view.corner, 0).rgb);
    // Rounds as the composite pass does.
    return as_trained(pixel, over, to_half(vec4(composite, 0.0)).rgb);
#else
    let value = unpack(textureLoad(filtered, pixel, 0));
    if value.owner == 0u {
        let shift = moved(pixel, over);
        return as_trained(pixel, over + vec4(shift, 0.0), value.color + shift);
    }
    let is_view = value.owner == screen.view_posterize;
    let shade = shade_of_owner(pixel, value.owner);
    let place = placed(value.owner - 1u, value);
    var posterized = assign(place, value.owner - 1u, shade.light);
#ifdef STEADY
    let at = vec2<f32>(pixel) + 0.5;
    let solid = textureLoad(depth, pixel, 0);
    let former = former_labels(value.owner - 1u, at, solid, posterized.label);
    posterized = steadied(posterized, place, value.owner - 1u, shade.light, former);
#endif
    let color = tinted(posterized.color, props[value.owner - 1u].tint * shade.tint);
    let opacity = shown_opacity(value.owner - 1u, over.a);
    return Seen(
        over_scene(color, select(opacity, 1.0, is_view), scene, pixel + view.corner),
        // A posterized view keeps the opacity of its pixels.
        select(opacity, over.a, is_view),
        2u + posterized.label,
        select(value.owner, 0u, is_view),
    );
#endif
}

struct Fragment {
    // Encoded sRGB, and opacity. The opacity is negative where nothing is drawn.
    @location(0) color: vec4<f32>,
#ifdef LABEL_TEXTURES
    // x: 0 where no prop is drawn, 1 where one is drawn as trained, or 2 + the index of the label. y: 1 + the index of
    // the posterized prop, or 0.
    @location(1) label: vec2<u32>,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let seen = seen_at(vec2<u32>(position.xy));
    let shown = select(vec4(seen.color, seen.alpha), vec4(0.0, 0.0, 0.0, -1.0), seen.label == 0u);
    return Fragment(
        shown,
#ifdef LABEL_TEXTURES
        vec2(seen.label, seen.owner),
#endif
    );
}
