// The grid of rays, the gaps between them, and the batches of gaps whose pixels get rays of their own.
//
// The gap of a ray of the grid consists of the pixels to the right of it and below, up to the next rays. The gaps of a
// square of the viewport that get rays form a batch. Their pixels are drawn side by side, in a square of textures of
// their own, so that pixels which are marched together all have a ray.
#define_import_path bevy_plenoctree::batch

#import bevy_plenoctree::view::view

// The pixels along a side of the square in which a batch is drawn. Matches `BATCH` in `slot.rs`.
const BATCH: u32 = 32u;
// The largest number of gaps in a batch, those of a grid of every second pixel. Matches `MOST_GAPS` in `slot.rs`.
const MOST_GAPS: u32 = 256u;

// What the check pass finds about a gap, if not 1 + its index in its batch.
const AGREES: u32 = 0u;
const EMPTY: u32 = 0xffffu;

// Divides integers below 65536, as floats: few GPUs can divide integers.
fn quotient(value: vec2<u32>, by: u32) -> vec2<u32> {
    return vec2<u32>((vec2<f32>(value) + 0.5) / f32(by));
}

// Returns one of the four rays of the grid around a gap.
fn ray_around(gap: vec2<u32>, index: u32) -> vec2<u32> {
    let rays = (view.size + view.spacing - 1u) / view.spacing;
    return min(gap + vec2(index & 1u, index >> 1u), rays - 1u);
}

// Returns the number of pixels of a gap.
fn pixels_of_gap() -> u32 {
    return view.spacing * view.spacing - 1u;
}

// Returns the number of gaps along a side of the square of a batch.
fn gaps_across() -> u32 {
    return BATCH / view.spacing;
}

// Returns the numbers of batches along each axis.
fn batches() -> vec2<u32> {
    let side = gaps_across() * view.spacing;
    return (view.size + side - 1u) / side;
}

// Returns the pixel within the square of a batch in which the element `index` of the batch is drawn. Eight elements are
// a block of 4 x 2 pixels, as they are marched together.
fn place_in_batch(index: u32) -> vec2<u32> {
    let block = index >> 3u;
    return vec2(4u * (block & 7u) + (index & 3u), 2u * (block >> 3u) + ((index >> 2u) & 1u));
}

// Returns the element that is drawn in a pixel within the square of a batch.
fn index_in_batch(place: vec2<u32>) -> u32 {
    let block = (place.y >> 1u) * 8u + (place.x >> 2u);
    return (block << 3u) | ((place.y & 1u) << 2u) | (place.x & 3u);
}

// Returns the number of rows of pixels in which `count` elements are drawn.
fn rows_of_batch(count: u32) -> u32 {
    return min(2u * ((count + 63u) / 64u), BATCH);
}

// Packs the place of a gap in the square of its batch.
fn pack_gap(place: vec2<u32>) -> u32 {
    return place.x | (place.y << 4u);
}

// Returns what `pack_gap` packed.
fn unpack_gap(word: u32) -> vec2<u32> {
    return vec2(word & 15u, word >> 4u);
}
