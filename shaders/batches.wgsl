// A triangle over the pixels of each batch, or two if one that covers them would be larger than the square of the batch,
// for the passes that march rays for them. Along the edge between two triangles, both are shaded in the same blocks of
// pixels, and small batches would be marched almost twice.

#import bevy_plenoctree::batch::{BATCH, PIXELS_OF_GAP, batch_of, batches, count_of, list_of, size_of_batch}
#import bevy_plenoctree::prop_ray::Varying
#import bevy_plenoctree::view::{NOWHERE, first_drawn, props}

// Corners of the unit square (bits x, y).
const CORNERS = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u);

// An instance is a prop and the part of the rays to draw, as in `box.wgsl`.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Varying {
    let prop = instance & 0xffffu;
    // Lists are not read where nothing is drawn.
    if first_drawn > 0u {
        return Varying(NOWHERE, prop, 0u);
    }
    let squares = batches();
#ifdef BATCHED
    // Those that may have pixels of the prop.
    let list = 0u;
    let first = props[prop].first_batch;
    let across = props[prop].batches_across;
#else
    // Those of all props of a field.
    let list = list_of(prop, #{PART}u);
    let first = vec2(0u);
    let across = squares.x;
#endif
    let square = first + vec2(index / 6u % across, index / 6u / across);
    var count = count_of(batch_of(BATCH * square, list));
#ifdef BATCHED
    count *= PIXELS_OF_GAP;
#endif
    let drawn = size_of_batch(count);
    let is_one = all(2u * drawn <= vec2(BATCH));
    if count == 0u || (is_one && index % 6u >= 3u) {
        return Varying(NOWHERE, prop, 0u);
    }
    var corners = CORNERS;
    let corner = vec2(corners[index % 6u] & 1u, corners[index % 6u] >> 1u);
    let at = vec2<f32>(BATCH * square + corner * select(drawn, 2u * drawn, is_one));
    let size = vec2<f32>(BATCH * squares);
    return Varying(vec4((2.0 * at / size - 1.0) * vec2(1.0, -1.0), 0.5, 1.0), prop, instance >> 16u);
}
