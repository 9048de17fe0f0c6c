// Finds the pixels at the edges of posterized props, and the props that may cover parts of them. Lists those that need
// rays for the coverage pass.
#define_import_path bevy_plenoctree::edge_owners

#import bevy_plenoctree::batch::{BATCH, WORDS_OF_EDGES, batch_of, list_of}
#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::edge::{
    MASK_OF_EDGES, MASK_OF_PROPS, RAYS, neighbor, ray_offset, sample_of, thinned, word_at, word_of,
}
#import bevy_plenoctree::view::{
    SMOOTHS_NOTHING, SMOOTHS_SLITS, is_solid, nearest_drawn, owner_of, props, scene_depth_at, screen, unpack_owner, view,
}

// The layer, as the outline pass and the composite pass bind it.
@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;

// What the coverage pass finds, as in `coverage.wgsl`.
@group(2) @binding(0) var<storage, read_write> coverage: array<u32>;
@group(2) @binding(1) var own_rays: texture_storage_2d<rgba16float, write>;
@group(2) @binding(2) var other_rays: texture_storage_2d<rgba16float, write>;
// Which pixels are in the batches of every list.
@group(2) @binding(3) var<storage, read_write> edges: array<atomic<u32>>;

// A pixel, and whether it is at an edge.
struct Edge {
    // The owner of the pixel, and the nearest other owner of a neighbor. 0 if there is none, or its edges stay hard. Both
    // are 0 away from edges.
    owners: vec2<u32>,
    // What the depth test of later passes compares with.
    mask: f32,
}

fn smooths(owner: u32) -> bool {
    return owner > 0u && props[max(owner, 1u) - 1u].smooths > SMOOTHS_NOTHING;
}

// What lets less light through is no slit.
const LEAST_TRANSMITTANCE: f32 = 0.02;

// Returns whether the center of a pixel sees a part of a slit: a neighbor lets less than half as much light through. In
// fog, neighbors differ less.
fn is_at_slit(pixel: vec2<i32>) -> bool {
    let transmittance = 1.0 - textureLoad(layer, pixel, 0).a;
    var least = transmittance;
    let neighbors = select(0, 8, transmittance > LEAST_TRANSMITTANCE);
    for (var i = 0; i < neighbors; i++) {
        least = min(least, 1.0 - textureLoad(layer, nearest_drawn(neighbor(pixel, i)), 0).a);
    }
    return 2.0 * least < transmittance;
}

// Returns whether a pixel is at an edge, and of which props.
fn edge_at(pixel: vec2<i32>) -> Edge {
    let texel = textureLoad(owner, pixel, 0);
    let own = owner_of(texel);
    let owned = unpack_owner(texel);
    let solid_here = textureLoad(depth, pixel, 0);
    // A posterized view shows all of its pixels.
    let inside = select(0.0, MASK_OF_PROPS, solid_here > 0.0 || screen.view_posterize > 0u);
    var differs = false;
    for (var i = 0; i < 8; i++) {
        let at = nearest_drawn(neighbor(pixel, i));
        differs = differs || unpack_owner(textureLoad(owner, at, 0)) != owned;
    }
    var ends = false;
    var other = 0u;
    var nearest = 0.0;
    let neighbors = select(0, 8, differs);
    for (var i = 0; i < neighbors; i++) {
        let at = nearest_drawn(neighbor(pixel, i));
        let there = owner_of(textureLoad(owner, at, 0));
        ends = ends || there != own;
        if there != own && smooths(there) {
            let solid = textureLoad(depth, at, 0);
            // Where neither is solid, the one that is drawn later is in front.
            if solid > nearest || (solid == nearest && there > other) {
                other = there;
                nearest = solid;
            }
        }
    }
    if own == 0u && other > 0u && textureLoad(layer, pixel, 0).a >= props[other - 1u].min_opacity {
        // A prop as trained covers the pixel. If it is solid there, the coverage pass knows what is in front of it.
        other = select(0u, other, is_solid(solid_here));
    }
    let kept = select(0u, own, smooths(own));
    let owners = vec2(kept, other);
    let may_have_slits = kept > 0u && props[max(kept, 1u) - 1u].smooths == SMOOTHS_SLITS;
    ends = ends || (may_have_slits && is_at_slit(pixel));
    var found = Edge(vec2(0u), inside);
    // Few pixels are at edges. A loop that runs once or never costs nothing where it runs for none of a group of pixels.
    for (var left = select(0, 1, ends && any(owners > vec2(0u))); left > 0; left--) {
        found = Edge(owners, MASK_OF_EDGES);
        var needs_rays = true;
#ifdef ESTIMATES
        let around = opacity_around(pixel, owners);
        let covered = covered_rays(around);
        if around.is_known {
            needs_rays = false;
            let covers_all = select(0u, (1u << RAYS) - 1u, around.center >= around.limit);
            if covered == covers_all {
                found = Edge(vec2(0u), inside);
            } else {
                estimate(pixel, owners, around, covered);
            }
        }
#endif
        if needs_rays {
            let last = select(owners.x, owners.y, owners.y > 0u);
            list(vec2<u32>(pixel), last - 1u, 0u);
            if all(owners > vec2(0u)) {
                list(vec2<u32>(pixel), owners.x - 1u, 1u);
            }
        }
    }
    return found;
}

// Adds a pixel to a list of a prop: to a batch of it.
fn list(pixel: vec2<u32>, prop: u32, part: u32) {
    let batch = batch_of(pixel, list_of(prop, part));
    let place = pixel.y % BATCH * BATCH + pixel.x % BATCH;
    atomicOr(&edges[WORDS_OF_EDGES * batch + place / 32u], 1u << (place % 32u));
}

#ifdef ESTIMATES
// What the opacity of a pixel at an edge and of its neighbors says about the part of it that a prop covers. Where cells are
// larger than two or three pixels, opacity changes gradually across an edge, and no ray needs to find it.

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
fn opacity_around(pixel: vec2<i32>, owners: vec2<u32>) -> Opacity {
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
        let toward = neighbor(pixel, i);
        let at = nearest_drawn(toward);
        let offset = vec2<f32>(toward - pixel);
        let opacity = textureLoad(layer, at, 0).a;
        let there = owner_of(textureLoad(owner, at, 0));
        is_alone = is_alone && all(at == toward) && there == select(0u, prop, opacity >= limit);
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

// Finds what the coverage pass does, from opacity, but no color of the prop: it is that of the pixel, or of the neighbor
// that sees most of the prop.
fn estimate(pixel: vec2<i32>, owners: vec2<u32>, around: Opacity, covered: u32) {
    var shown = covered;
    var kept = 0u;
#ifdef MULTISAMPLED
    // The nearest depth of the prop.
    var solid = 0.0;
    for (var i = 0; i < 9; i++) {
        let at = nearest_drawn(pixel + vec2(i % 3 - 1, i / 3 - 1));
        let is_own = owner_of(textureLoad(owner, at, 0)) == max(owners.x, owners.y);
        solid = select(solid, max(solid, textureLoad(depth, at, 0)), is_own);
    }
    for (var ray = 0u; ray < RAYS; ray++) {
        let sample = sample_of(ray, #{SAMPLES}u);
        let is_covered = ((covered >> ray) & 1u) == 1u;
        let is_hidden = is_covered && is_solid(solid) && scene_depth_at(vec2<u32>(pixel), sample) > solid;
        shown &= ~select(0u, 1u << ray, is_hidden);
        kept |= select(0u, 1u << sample, is_hidden);
    }
#endif
    var bits = vec4(shown, 0u, 0u, kept);
    var own = vec4(0.0);
    if owners.x == 0u {
        bits = vec4(0u, shown, shown, kept);
        // The opacities of the rays that are not covered, and their number.
        var thin = vec2(0.0);
        for (var ray = 0u; ray < RAYS; ray++) {
            let is_covered = ((covered >> ray) & 1u) == 1u;
            thin += select(vec2(opacity_at(around, ray_offset(ray)), 1.0), vec2(0.0), is_covered);
        }
        let center = textureLoad(layer, pixel, 0);
        own = to_half(thinned(center, center / max(center.a, 1e-6) * thin.x / max(thin.y, 1.0)));
    }
    coverage[word_at(vec2<u32>(pixel), view.size.x)] = word_of(bits);
    textureStore(own_rays, pixel, own);
    textureStore(other_rays, pixel, vec4(0.0));
}
#endif
