// The fill pass: completes the layer. Interpolates the rays of the grid bilinearly across gaps where they agree, and
// takes the pixels of other gaps from where their batches were drawn.

#import bevy_plenoctree::batch::{
    BATCH, EMPTY, GAPS_ACROSS, NEEDS_RAYS, PIXELS_OF_GAP, SPACING, WORDS_OF_GAPS, batch_of, place_in_batch, place_of_gap,
    ray_around,
}
#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::view::is_solid

// The results of the check pass.
@group(1) @binding(0) var gaps: texture_2d<u32>;
@group(1) @binding(1) var<storage, read> listed_gaps: array<u32>;
// The rays of the grid.
@group(1) @binding(2) var color: texture_2d<f32>;
@group(1) @binding(3) var owner: texture_2d<f32>;
@group(1) @binding(4) var depth: texture_depth_2d;
// The batches.
@group(1) @binding(5) var batched_color: texture_2d<f32>;
@group(1) @binding(6) var batched_owner: texture_2d<f32>;
@group(1) @binding(7) var batched_depth: texture_depth_2d;
#ifdef MOTION
@group(1) @binding(8) var motion: texture_2d<f32>;
@group(1) @binding(9) var batched_motion: texture_2d<f32>;
#endif

struct Fragment {
    @location(0) color: vec4<f32>,
    @location(1) owner: vec4<f32>,
    @builtin(frag_depth) depth: f32,
#ifdef MOTION
    // Views with a grid of rays have owners.
    @location(2) motion: vec4<f32>,
#endif
}

// Returns the index of a gap in its batch.
fn index_of(gap: vec2<u32>) -> u32 {
    let first = WORDS_OF_GAPS * batch_of(gap * SPACING, 0u);
    let place = place_of_gap(gap);
    var index = countOneBits(listed_gaps[first + place / 32u] & ((1u << (place % 32u)) - 1u));
    for (var word = 0u; word < place / 32u; word++) {
        index += countOneBits(listed_gaps[first + word]);
    }
    return index;
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy);
    let gap = pixel / SPACING;
    let beyond = pixel % SPACING;
    let found = textureLoad(gaps, gap, 0).x;
    let is_batched = found == NEEDS_RAYS && any(beyond > vec2(0u));
    // The pixel may hold what was drawn before.
    var filled = Fragment();

    let batched = select(0u, 1u, is_batched);
    for (var i = 0u; i < batched; i++) {
        let index = index_of(gap) * PIXELS_OF_GAP + beyond.y * SPACING + beyond.x - 1u;
        let at = BATCH * (gap / GAPS_ACROSS) + place_in_batch(index);
        filled.color = textureLoad(batched_color, at, 0);
        filled.owner = textureLoad(batched_owner, at, 0);
        filled.depth = textureLoad(batched_depth, at, 0);
#ifdef MOTION
        filled.motion = textureLoad(batched_motion, at, 0);
#endif
    }

    let share = vec2<f32>(beyond) / f32(SPACING);
    let rays = select(4u, 0u, is_batched || found == EMPTY);
    var sum = vec4(0.0);
    // The ray that the pixel shows most of.
    var best = 0.0;
    var at_best = gap;
    var depth_at_best = 0.0;
    // The mean depth of solid rays, and how they have moved.
    var solid_depth = 0.0;
    var solid_weight = 0.0;
#ifdef MOTION
    var moved = vec2(0.0);
#endif
    for (var i = 0u; i < rays; i++) {
        let at = ray_around(gap, i);
        let along = select(1.0 - share, share, vec2(i & 1u, i >> 1u) > vec2(0u));
        let weight = along.x * along.y;
        let value = textureLoad(color, at, 0);
        let there = textureLoad(depth, at, 0);
        sum += weight * value;
        if weight * value.a > best {
            best = weight * value.a;
            at_best = at;
            depth_at_best = there;
        }
        if is_solid(there) {
            solid_depth += weight * there;
            solid_weight += weight;
#ifdef MOTION
            moved += weight * textureLoad(motion, at, 0).xy;
#endif
        }
    }
    if best > 0.0 {
        let is_solid_there = is_solid(depth_at_best) && solid_weight > 0.0;
        filled.color = to_half(sum);
        filled.owner = textureLoad(owner, at_best, 0);
        filled.depth = select(depth_at_best, solid_depth / solid_weight, is_solid_there);
#ifdef MOTION
        filled.motion = vec4(select(vec2(0.0), moved / solid_weight, is_solid_there), 0.0, 1.0);
#endif
    }
    return filled;
}
