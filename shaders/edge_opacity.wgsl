// What the opacity of a pixel at an edge and of its neighbors says about the part of it that a prop covers. Where cells are
// larger than two or three pixels, opacity changes gradually across an edge, and no ray needs to find it.
#define_import_path bevy_plenoctree::edge_opacity

#import bevy_plenoctree::edge::{RAYS, neighbor, ray_offset}
#import bevy_plenoctree::view::{SMOOTHS_SLITS, is_drawn, owner_of, props, view}

// The opacity around the center of a pixel, as a polynomial of degree 2.
struct Opacity {
    center: f32,
    slope: vec2<f32>,
    // Its second derivatives: along x, along y, and along both.
    bend: vec3<f32>,
    // From which opacity the prop covers what a ray sees.
    limit: f32,
    // Whether it says where the prop ends: it is that of one prop, which ends between two of the pixels, and it is nearly
    // linear.
    is_known: bool,
}

// How far opacity may be from a plane, at the pixels beside the center, if a prop must be half opaque to cover them. Near 0
// and 1, opacity bends more, and less is allowed.
const MOST_DEVIATION: f32 = 0.2;
// How much opacity must and may change from pixel to pixel. In fog, where it changes less, details that are smaller than a
// pixel decide where it is enough. Where it changes more, it may do so anywhere between two pixels.
const LEAST_SLOPE: f32 = 0.1;
const MOST_SLOPE: f32 = 0.4;
// How much it may bend, relative to its slope. Next to a step, which may be anywhere between two pixels, it is 2.
const MOST_BEND: f32 = 1.6;

// Returns the opacity around a pixel of two owners, as in `Edge`.
fn opacity_around(layer: texture_2d<f32>, owner: texture_2d<f32>, pixel: vec2<i32>, owners: vec2<u32>) -> Opacity {
    let prop = max(owners.x, owners.y);
    let limit = min(props[max(prop, 1u) - 1u].min_opacity, 1.0 - view.stop_transmittance);
    let center = textureLoad(layer, pixel, 0).a;
    // Where boxes of props overlap, opacity may be that of several.
    let may_be_alone = props[max(prop, 1u) - 1u].smooths == SMOOTHS_SLITS && min(owners.x, owners.y) == 0u;
    var is_alone = prop > 0u && may_be_alone && (owners.x > 0u) == (center >= limit);
    var ends = false;
    // Sums over the neighbors beside the pixel, and over those across.
    var along = vec2(0.0);
    var total = vec2(0.0);
    var across = vec2(0.0);
    var twist = 0.0;
    // A loop that runs once or never costs nothing where it runs for none of a group of pixels.
    let neighbors = select(0, 8, is_alone);
    for (var i = 0; i < neighbors; i++) {
        let at = neighbor(pixel, i);
        let offset = vec2<f32>(at - pixel);
        let opacity = textureLoad(layer, at, 0).a;
        let there = owner_of(textureLoad(owner, at, 0));
        is_alone = is_alone && is_drawn(vec2<u32>(at)) && there == select(0u, prop, opacity >= limit);
        ends = ends || (opacity >= limit) != (center >= limit);
        let beside = select(opacity, 0.0, i > 3);
        along += beside * offset;
        total += beside * abs(offset);
        across += (opacity - beside) * offset;
        twist += (opacity - beside) * offset.x * offset.y;
    }
    let slope = 0.5 * along;
    let bend = total - 2.0 * center;
    // How far the pixels beside the center are from a plane that is fitted to all, as Sobel does.
    let off = 0.5 * abs(bend) + abs(slope - 0.25 * along - 0.125 * across);
    let allowed = 4.0 * MOST_DEVIATION * limit * (1.0 - limit);
    let is_gradual = length(slope) >= LEAST_SLOPE && all(abs(slope) < vec2(MOST_SLOPE));
    let is_straight = max(off.x, off.y) < allowed && all(abs(bend) < vec2(MOST_BEND * length(slope)));
    return Opacity(center, slope, vec3(bend, 0.25 * twist), limit, is_alone && ends && is_gradual && is_straight);
}

// Returns the opacity at an offset from the center, in pixels.
fn opacity_at(around: Opacity, offset: vec2<f32>) -> f32 {
    let bend = 0.5 * dot(around.bend.xy, offset * offset) + around.bend.z * offset.x * offset.y;
    return clamp(around.center + dot(around.slope, offset) + bend, 0.0, 1.0);
}

// Returns the bits of the rays that are covered.
fn covered_rays(around: Opacity) -> u32 {
    var covered = 0u;
    for (var ray = 0u; ray < RAYS; ray++) {
        covered |= select(0u, 1u << ray, opacity_at(around, ray_offset(ray)) >= around.limit);
    }
    return covered;
}
