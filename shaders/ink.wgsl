// Draws lines: along silhouettes, where depth breaks, and between ramps. See `Ink`.
//
// A pixel looks at others in a disk around it. The share of them that lie beyond an edge tells how far away the edge is:
// averaged over a disk, edges are smooth.
#define_import_path bevy_plenoctree::ink

#import bevy_plenoctree::labels::{RAMPS, ramp_of}
#import bevy_plenoctree::view::{
    colors, distance_from_depth, is_solid, labelings, nearest_drawn, props, scene_depth_at, view,
}

@group(1) @binding(2) var depth: texture_depth_2d;
// The result of the label pass.
@group(1) @binding(4) var labels: texture_2d<u32>;

const INK_SILHOUETTE: u32 = 1u;
const INK_CREASES: u32 = 2u;
// Lines between ramps, between all labels, or between the ramps of pairs.
const INK_RAMPS: u32 = 4u;
const INK_LABELS: u32 = 8u;
const INK_PAIRS: u32 = 16u;

// What a pixel sees.
struct Surface {
    // 1 + the index of the prop, or 0.
    owner: u32,
    label: u32,
    // Along the view axis: of the prop where it is solid, or else of the scene.
    distance: f32,
    has_depth: bool,
}

// Returns what a pixel sees.
fn surface_at(pixel: vec2<i32>) -> Surface {
    let at = nearest_drawn(pixel);
    let texel = textureLoad(labels, at, 0).xy;
    let solid = textureLoad(depth, at, 0);
    if is_solid(solid) {
        return Surface(texel.y, texel.x, distance_from_depth(solid), true);
    }
    return Surface(texel.y, texel.x, distance_from_depth(scene_depth_at(vec2<u32>(at), 0u)), false);
}

// Returns whether there is a line between two labels of a prop.
fn is_border(prop: u32, a: u32, b: u32) -> bool {
    let ink = labelings[prop].ink.lines;
    if a == b || a < 2u || b < 2u || (ink & (INK_RAMPS | INK_LABELS | INK_PAIRS)) == 0u {
        return false;
    }
    if (ink & INK_LABELS) != 0u {
        return true;
    }
    let ramps = vec2(ramp_of(prop, a - 2u), ramp_of(prop, b - 2u));
    if (ink & INK_PAIRS) == 0u {
        return ramps.x != ramps.y;
    }
    let first = min(ramps.x, RAMPS - 1u);
    let bits = u32(colors[labelings[prop].ink.pairs + first][(ramps.y & 63u) >> 4u]);
    return max(ramps.x, ramps.y) < RAMPS && ((bits >> (ramps.y & 15u)) & 1u) == 1u;
}

// Whether a pixel lies beyond an edge behind which something farther away begins, or beyond a border, from 0 to 1.
struct Beyond {
    edge: f32,
    border: f32,
}

// `opposite` is on the other side of the center.
fn beyond(center: Surface, is_opaque: bool, there: Surface, opposite: Surface) -> Beyond {
    let prop = center.owner - 1u;
    let ink = labelings[prop].ink.lines;
    let step = there.distance - center.distance;
    if there.owner != center.owner {
        return Beyond(select(0.0, 1.0, (ink & INK_SILHOUETTE) != 0u && (step > 0.0 || !center.has_depth)), 0.0);
    }
    // On a slope, depth changes as much on the other side. Where it breaks on both sides, there is noise, or something thin.
    let before = select(0.0, center.distance - opposite.distance, opposite.owner == center.owner && opposite.has_depth);
    // Creases that are hardly deep enough are faint. Where noise decides, lines would be dots.
    let depth = (step - 2.0 * abs(before)) / labelings[prop].ink.crease;
    // The depth of glass is that of its front or its back, wherever enough of it is.
    let can_crease = (ink & INK_CREASES) != 0u && is_opaque && center.has_depth && there.has_depth;
    let crease = select(0.0, clamp(2.0 * depth - 2.0, 0.0, 1.0), can_crease);
    return Beyond(crease, select(0.0, 1.0, crease == 0.0 && is_border(prop, center.label, there.label)));
}

// How much less a pair counts whose pixels are both beyond an edge.
const PINCHED: f32 = 0.5;

// Returns what a pair of pixels on opposite sides of the center says about the share of the disk beyond an edge. Where both
// are beyond it, what is between them is thin, and gets a thinner line, unless it is only a seam between these two.
fn weight(first: f32, second: f32, is_seam: bool) -> f32 {
    return max(first, second) - select(1.0 + PINCHED, 0.0, is_seam) * min(first, second);
}

// The pixels of the disk, in pairs on opposite sides of the center. If those near the rim show no edge, there is none.
const PAIRS: u32 = 24u;
const RIM: u32 = 7u;
// The angle between two pairs, in radians: no two are in line.
const TURN: f32 = 2.399963;

// Returns how far an edge is from the center of a disk with a radius of 1, from the share of the disk beyond it.
fn distance_of(share: f32) -> f32 {
    let rest = max(1.0 - 2.0 * share, 0.0);
    return rest * (0.785 + 0.215 * rest * rest);
}

// The least radius of the disk, in pixels: smaller ones would take noise for lines.
const LEAST_RADIUS: f32 = 2.35;

// Returns the part of a pixel that lines cover. `center` is what it sees of a prop, or would, and `is_opaque` says whether
// nothing shows through that.
fn ink_at(pixel: vec2<i32>, center: Surface, is_opaque: bool) -> f32 {
    if center.owner == 0u || labelings[center.owner - 1u].ink.lines == 0u {
        return 0.0;
    }
    let ink = labelings[center.owner - 1u].ink;
    // The distance of haze and glass is unknown, but for that of the prop's box.
    let away = select(props[center.owner - 1u].near, center.distance, center.has_depth);
    let wanted = ink.width / max(view.depth.w - away * view.depth.z, 1e-20);
    let width = clamp(wanted, 1.0, ink.max_pixels);
    let radius = max(width + 1.0, LEAST_RADIUS);
    var has_edge = false;
    var has_border = false;
    // The weights of edges and of borders.
    var sums = vec2(0.0);
    for (var i = 0u; i < PAIRS; i++) {
        if i == RIM && !has_edge && !has_border {
            return 0.0;
        }
        let away = radius * sqrt((f32(PAIRS - i) - 0.5) / f32(PAIRS));
        let angle = TURN * f32(i);
        let offset = vec2<i32>(round(away * vec2(cos(angle), sin(angle))));
        let first = surface_at(pixel + offset);
        let second = surface_at(pixel - offset);
        let there = beyond(center, is_opaque, first, second);
        let opposite = beyond(center, is_opaque, second, first);
        let is_seam = there.border * opposite.border > 0.0 && is_border(center.owner - 1u, first.label, second.label);
        sums += vec2(weight(there.edge, opposite.edge, false), weight(there.border, opposite.border, is_seam));
        has_edge = has_edge || there.edge + opposite.edge > 0.0;
        has_border = has_border || there.border + opposite.border > 0.0;
    }
    let shares = max(sums, vec2(0.0)) / f32(2u * PAIRS);
    let edge = select(0.0, width - radius * distance_of(shares.x) + 0.5, has_edge);
    let border = select(0.0, 0.5 * width - radius * distance_of(shares.y) + 0.5, has_border);
    return clamp(max(edge, border), 0.0, 1.0) * min(2.0 * wanted, 1.0) * ink.color.a;
}

// Returns a color of a prop, in linear light, with a line over it that covers a part of the pixel.
fn inked(prop: u32, tint: vec3<f32>, color: vec3<f32>, part: f32) -> vec3<f32> {
    let line = labelings[prop].ink.color.rgb * tint + labelings[prop].ink.tone * color;
    return mix(color, line, part);
}
