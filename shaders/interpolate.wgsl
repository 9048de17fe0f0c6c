// The interpolate pass: interpolates the rays of the grid bilinearly where they agree, and adds all other pixels to the
// batches that get rays of their own.

#import bevy_plenoctree::batch::{BATCH, batch_of}
#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::scene::scene_depth
#import bevy_plenoctree::view::{is_drawn, is_solid, view}

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;
// The number of pixels in every batch, and the pixels: their places in the square, row by row.
@group(1) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
@group(1) @binding(4) var<storage, read_write> pixels: array<u32>;
#ifdef MOTION
@group(1) @binding(5) var motion: texture_2d<f32>;
#endif

struct Fragment {
    @location(0) color: vec4<f32>,
    @location(1) owner: vec4<f32>,
    // 1 + the index of the pixel in its batch, or 0 if it is interpolated.
    @location(2) index: u32,
    @builtin(frag_depth) depth: f32,
#ifdef MOTION
    @location(3) motion: vec4<f32>,
#endif
}

// The largest relative difference of depths at pixels where the scene shows the same surface. In perspective, this is the
// relative difference of distances.
const SAME_SURFACE: f32 = 0.05;

// Returns one of the four rays of the grid around a pixel.
fn tap_at(corner: vec2<u32>, tap: u32, last: vec2<u32>) -> vec2<u32> {
    return min(corner + vec2(tap & 1u, tap >> 1u), last);
}

// Returns the weight of that ray.
fn tap_weight(share: vec2<f32>, tap: u32) -> f32 {
    let along = select(1.0 - share, share, vec2(tap & 1u, tap >> 1u) > vec2(0u));
    return along.x * along.y;
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy);
    // Software rasterizers divide integers slowly.
    let corner = vec2<u32>((vec2<f32>(pixel) + 0.5) / f32(view.spacing));
    let beyond = pixel - corner * view.spacing;
    let share = vec2<f32>(beyond) / f32(view.spacing);
    let last = textureDimensions(layer) - 1u;

    var color = vec4(0.0);
    var least = vec4(1e30);
    var most = vec4(-1e30);
    var best = 0.0;
    var at_best = corner;
    for (var tap = 0u; tap < 4u; tap++) {
        let at = tap_at(corner, tap, last);
        let value = textureLoad(layer, at, 0);
        let weight = tap_weight(share, tap);
        color += weight * value;
        least = min(least, value);
        most = max(most, value);
        if weight * value.a > best {
            best = weight * value.a;
            at_best = at;
        }
    }

    // The mean depth of solid rays, and how they have moved.
    var solid_depth = 0.0;
    var solid_weight = 0.0;
#ifdef MOTION
    var moved = vec2(0.0);
#endif
    // The least and the greatest depths of solid rays, and those of the scene where the rays of the grid ended at it.
    var solid_depths = vec2(1.0, 0.0);
    var scene_depths = vec2(textureLoad(scene_depth, pixel + view.corner, 0));
    var differ = false;
    let first = textureLoad(owner, corner, 0).rg;
    // Software rasterizers skip loops, not branches.
    let taps = select(0u, 4u, most.a > 0.0);
    for (var tap = 0u; tap < taps; tap++) {
        let at = tap_at(corner, tap, last);
        differ = differ || any(textureLoad(owner, at, 0).rg != first);
        let solid = textureLoad(depth, at, 0);
        if is_solid(solid) {
            let weight = tap_weight(share, tap);
            solid_depths = vec2(min(solid_depths.x, solid), max(solid_depths.y, solid));
            solid_depth += weight * solid;
            solid_weight += weight;
#ifdef MOTION
            moved += weight * textureLoad(motion, at, 0).xy;
#endif
        }
        let there = textureLoad(scene_depth, at * view.spacing + view.corner, 0);
        scene_depths = vec2(min(scene_depths.x, there), max(scene_depths.y, there));
    }
    let spread = most - least;
    let error = max(max(spread.r, spread.g), max(spread.b, spread.a));
    let needs_ray = differ
        || error > view.error
        || solid_depths.y - solid_depths.x > view.error * solid_depths.y
        || scene_depths.y - scene_depths.x > SAME_SURFACE * scene_depths.y;
    var index = 0u;
    if needs_ray && any(beyond > vec2(0u)) && is_drawn(pixel) {
        let batch = batch_of(pixel);
        index = atomicAdd(&counts[batch], 1u);
        pixels[batch * BATCH * BATCH + index] = pixel.y % BATCH * BATCH + pixel.x % BATCH;
        index += 1u;
    }
    if best == 0.0 {
        // The pixel may hold what was drawn before.
        var nothing = Fragment();
        nothing.index = index;
        return nothing;
    }
    let depth_there = textureLoad(depth, at_best, 0);
    let is_solid_there = is_solid(depth_there) && solid_weight > 0.0;
    return Fragment(
        to_half(color),
        textureLoad(owner, at_best, 0),
        index,
        select(depth_there, solid_depth / solid_weight, is_solid_there),
#ifdef MOTION
        vec4(select(vec2(0.0), moved / solid_weight, is_solid_there), 0.0, 1.0),
#endif
    );
}
