// Keeps labels while something moves, so that they do not flicker. See `Posterize::steadiness`.
#define_import_path bevy_plenoctree::steady

#import bevy_plenoctree::labels::{Shown, label_at, place_of, shown_at}
#import bevy_plenoctree::shade::Light
#import bevy_plenoctree::view::{is_solid, labelings, view, view_distance}

// The largest difference of distances at which two frames see the same part of a prop, relative to the distance.
const SAME: f32 = 0.01;

// The labels of the former frame around a point of a prop, plus 2 (0 where it saw something else), and their bilinear
// weights.
struct Former {
    labels: vec4<u32>,
    weights: vec4<f32>,
}

// `at` is the place of the point, in pixels.
fn former_labels(labels: texture_2d<u32>, depths: texture_depth_2d, prop: u32, at: vec2<f32>, depth: f32) -> Former {
    var found = Former(vec4(0u), vec4(0.0));
    if labelings[prop].former == 0u || !is_solid(depth) {
        return found;
    }
    let now = vec4((2.0 * at / vec2<f32>(view.size) - 1.0) * vec2(1.0, -1.0), depth, 1.0);
    let clip = labelings[prop].former_from_clip * now;
    let before = clip.xyz / clip.w;
    let size = labelings[prop].former_size;
    let place = (0.5 + 0.5 * before.xy * vec2(1.0, -1.0)) * size - 0.5;
    if clip.w <= 0.0 || any(place < vec2(0.0)) || any(place >= size - 1.0) {
        return found;
    }
    let corner = floor(place);
    let share = place - corner;
    for (var i = 0u; i < 4u; i++) {
        let offset = vec2(i & 1u, i >> 1u);
        let texel = textureLoad(labels, vec2<u32>(corner) + offset, 0).xy;
        let solid = textureLoad(depths, vec2<u32>(corner) + offset, 0);
        let distance = view_distance(solid);
        let is_same = is_solid(solid) && abs(view_distance(before.z) - distance) < SAME * distance;
        let along = select(1.0 - share, share, offset == vec2(1u));
        found.labels[i] = select(0u, texel.x, is_same && texel.y == labelings[prop].former);
        found.weights[i] = select(0.0, along.x * along.y, found.labels[i] >= 2u);
    }
    return found;
}

fn support(former: Former, label: u32) -> f32 {
    return dot(select(vec4(0.0), former.weights, former.labels == vec4(label + 2u)), vec4(1.0));
}

// Returns the label that is nearest to a place, if those count as nearer that the former frame had there.
fn steadied(nearest: Shown, place: vec3<f32>, prop: u32, light: Light, former: Former) -> Shown {
    let steadiness = labelings[prop].steadiness;
    var best = nearest.label;
    var least = distance(place, place_of(prop, label_at(prop, best))) - steadiness * support(former, best);
    for (var i = 0u; i < 4u; i++) {
        let label = max(former.labels[i], 2u) - 2u;
        if former.labels[i] >= 2u && label != nearest.label {
            let off = distance(place, place_of(prop, label_at(prop, label))) - steadiness * support(former, label);
            best = select(best, label, off < least);
            least = min(least, off);
        }
    }
    if best == nearest.label {
        return nearest;
    }
    return Shown(shown_at(prop, best, light), best);
}
