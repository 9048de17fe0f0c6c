// Keeps labels while something moves, so that they do not flicker. See `Posterize::steadiness`.
#define_import_path bevy_plenoctree::steady

#import bevy_plenoctree::labels::{Shown, label_at, place_of, shown_at}
#import bevy_plenoctree::shade::Light
#import bevy_plenoctree::view::{is_solid, labelings, view, distance_from_depth}

// The largest difference of distances at which two frames see the same part of a prop, relative to the distance.
const SAME: f32 = 0.01;
// The part of the steadiness that counts where a border between labels may have moved.
const MOVED: f32 = 0.5;

// The labels of the former frame around a point of a prop, plus 2 (0 where it saw something else), and their bilinear
// weights.
struct Former {
    labels: array<u32, 9>,
    weights: array<f32, 9>,
}

// `at` is the place of the point, in pixels.
fn former_labels(labels: texture_2d<u32>, depths: texture_depth_2d, prop: u32, at: vec2<f32>, depth: f32) -> Former {
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
    let nearest = floor(place + 0.5);
    for (var i = 0; i < 9; i++) {
        let there = nearest + vec2(f32(i % 3 - 1), f32(i / 3 - 1));
        let pixel = vec2<u32>(max(there, vec2(0.0)));
        let texel = textureLoad(labels, pixel, 0).xy;
        let solid = textureLoad(depths, pixel, 0);
        let distance = distance_from_depth(solid);
        let is_same = is_solid(solid) && abs(distance_from_depth(before.z) - distance) < SAME * distance;
        found.labels[i] = select(0u, texel.x, is_same && texel.y == labelings[prop].former.owner);
        let along = max(1.0 - abs(place - there), vec2(0.0));
        found.weights[i] = along.x * along.y;
    }
    return found;
}

// Returns the share of the bilinear weights that a label has.
fn support(former: Former, label: u32) -> f32 {
    var sum = 0.0;
    for (var i = 0; i < 9; i++) {
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
