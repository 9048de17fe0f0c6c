// The check pass: compares the rays of the grid around each gap. Where they differ, the pixels of the gap get rays of
// their own: the gap joins its batch.

#import bevy_plenoctree::batch::{
    AGREES, EMPTY, NEEDS_RAYS, SPACING, WORDS_OF_GAPS, batch_of, place_of_gap, ray_around,
}
#import bevy_plenoctree::view::{distance_from_depth, is_solid, length_at, scene_depth_at, unpack_owner, view}

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;
// Which gaps are in batches.
@group(2) @binding(0) var<storage, read_write> gaps: array<atomic<u32>>;

// The largest difference of distances at pixels where the scene shows the same surface. See `are_apart`.
const SAME_SURFACE: f32 = 0.05;

// Returns whether the distances of the least and the greatest depth differ by more than a part of the larger distance or,
// with parallel rays, of the height of the view.
fn are_apart(depths: vec2<f32>, part: f32) -> bool {
    let far = distance_from_depth(depths.x);
    return depths.y > depths.x && far - distance_from_depth(depths.y) > part * length_at(far);
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) u32 {
    let gap = vec2<u32>(position.xy);
    var least = vec4(1e30);
    var most = vec4(-1e30);
    for (var i = 0u; i < 4u; i++) {
        let value = textureLoad(layer, ray_around(gap, i), 0);
        least = min(least, value);
        most = max(most, value);
    }
    let is_empty = most.a <= 0.0;

    // The least and the greatest depths of solid rays.
    var solid_depths = vec2(1.0, 0.0);
    var differ = false;
    let first = unpack_owner(textureLoad(owner, gap, 0));
    let rays = select(4u, 0u, is_empty);
    for (var i = 0u; i < rays; i++) {
        let at = ray_around(gap, i);
        differ = differ || unpack_owner(textureLoad(owner, at, 0)) != first;
        let solid = textureLoad(depth, at, 0);
        if is_solid(solid) {
            solid_depths = vec2(min(solid_depths.x, solid), max(solid_depths.y, solid));
        }
    }
    // The least and the greatest depths of the scene, where these rays and those of the gap end at it.
    var scene_depths = vec2(1e30, -1e30);
    const ACROSS = SPACING + 1u;
    let pixels = select(ACROSS * ACROSS, 0u, is_empty);
    for (var i = 0u; i < pixels; i++) {
        let at = min(gap * SPACING + vec2(i % ACROSS, i / ACROSS), view.size - 1u);
        let there = scene_depth_at(at, 0u);
        scene_depths = vec2(min(scene_depths.x, there), max(scene_depths.y, there));
    }

    // At the end of an even view, there are pixels beyond the last rays.
    let is_at_end = any((gap + 1u) * SPACING == view.size);
    let spread = most - least;
    let error = max(max(spread.r, spread.g), max(spread.b, spread.a));
    let needs_rays = differ
        || error > view.ray_tolerance
        || are_apart(solid_depths, view.ray_tolerance)
        || are_apart(scene_depths, SAME_SURFACE)
        || is_at_end;
    var found = select(AGREES, EMPTY, is_empty);
    if needs_rays {
        let place = place_of_gap(gap);
        atomicOr(&gaps[WORDS_OF_GAPS * batch_of(gap * SPACING, 0u) + place / 32u], 1u << (place % 32u));
        found = NEEDS_RAYS;
    }
    return found;
}
