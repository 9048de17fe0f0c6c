// Batches: the pixels of a square of the viewport that get rays of their own. They are drawn side by side, in the place of
// that square in textures of their own, so that pixels which are marched together all have a ray.
#define_import_path bevy_plenoctree::batch

#import bevy_plenoctree::view::view

// The pixels along a side of a square. Matches `BATCH` in `refine/batches.rs`.
const BATCH: u32 = 32u;

// Returns the number of squares in a row.
fn batches_across() -> u32 {
    return (view.size.x + BATCH - 1u) / BATCH;
}

// Returns the index of the square that a pixel is in.
fn batch_of(pixel: vec2<u32>) -> u32 {
    return pixel.y / BATCH * batches_across() + pixel.x / BATCH;
}

// Returns the upper left corner of the square that a pixel is in.
fn corner_at(pixel: vec2<u32>) -> vec2<u32> {
    return pixel / BATCH * BATCH;
}

// Returns the pixel within a square in which the element `index` of its batch is drawn. Eight elements are a block of
// 4 x 2 pixels, as they are marched together.
fn place_in_batch(index: u32) -> vec2<u32> {
    let block = index >> 3u;
    return vec2(4u * (block & 7u) + (index & 3u), 2u * (block >> 3u) + ((index >> 2u) & 1u));
}

// Returns the element that is drawn in a pixel within a square.
fn index_in_batch(place: vec2<u32>) -> u32 {
    let block = (place.y >> 1u) * 8u + (place.x >> 2u);
    return (block << 3u) | ((place.y & 1u) << 2u) | (place.x & 3u);
}

// Returns the number of rows of pixels in which a batch of `count` pixels is drawn.
fn rows_of_batch(count: u32) -> u32 {
    return min(2u * ((count + 63u) / 64u), BATCH);
}
