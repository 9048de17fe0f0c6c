// Two triangles over the pixels of each batch, for the passes that march rays for them.

#import bevy_plenoctree::batch::{BATCH, PIXELS_OF_GAP, batch_of, batches, counts, list_of, rows_of_batch}
#import bevy_plenoctree::prop_ray::Varying
#import bevy_plenoctree::view::{NOWHERE, first_drawn}

// Corners of the unit square (bits x, y).
const CORNERS = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u);

// An instance is a prop and the part of the rays to draw, as in `box.wgsl`.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Varying {
    let prop = instance & 0xffffu;
    let all = batches();
    let square = vec2(index / 6u % all.x, index / 6u / all.x);
#ifdef BATCHED
    let list = 0u;
#else
    let list = list_of(prop, #{PART}u);
#endif
    let count = counts[batch_of(BATCH * square, list)];
    if first_drawn > 0u || count == 0u {
        return Varying(NOWHERE, prop, 0u);
    }
    var corners = CORNERS;
    let corner = vec2(corners[index % 6u] & 1u, corners[index % 6u] >> 1u);
#ifdef BATCHED
    let rows = rows_of_batch(count * PIXELS_OF_GAP);
#else
    let rows = rows_of_batch(count);
#endif
    let at = vec2<f32>(BATCH * square + corner * vec2(BATCH, rows));
    let size = vec2<f32>(BATCH * all);
    return Varying(vec4((2.0 * at / size - 1.0) * vec2(1.0, -1.0), 0.5, 1.0), prop, instance >> 16u);
}
