// The grid of rays, one for every second pixel along each axis, the gaps between them, and the batches of gaps whose pixels
// get rays of their own.
//
// The gap of a ray of the grid consists of the pixels to the right of it and below, up to the next rays. The gaps of a
// square of the viewport that get rays form a batch. Their pixels are drawn side by side, in a square of textures of
// their own, so that pixels which are marched together all have a ray. So are the pixels at edges that need rays.
#define_import_path bevy_plenoctree::batch

#import bevy_plenoctree::view::{props, view}

// Pixels per ray of the grid, along each axis. Matches `SPACING` of the plan.
const SPACING: u32 = 2u;
// The pixels of a gap.
const PIXELS_OF_GAP: u32 = SPACING * SPACING - 1u;
// The pixels along a side of the square whose elements form a batch, and of the one in which it is drawn. Matches `BATCH` of
// the plan.
const BATCH: u32 = 16u;
// The words of a list that say which pixels of a square are in a batch, a bit each.
const WORDS_OF_BATCH: u32 = BATCH * BATCH / 32u;
// The gaps along a side of that square.
const GAPS_ACROSS: u32 = BATCH / SPACING;
// The largest number of gaps in a batch.
const MOST_GAPS: u32 = GAPS_ACROSS * GAPS_ACROSS;

// What the check pass finds about a gap, if not 1 + its index in its batch.
const AGREES: u32 = 0u;
const EMPTY: u32 = 0xffffu;

// The number of elements of every batch, for the passes that march rays for them.
@group(0) @binding(8) var<storage, read> counts: array<u32>;

// Returns one of the four rays of the grid around a gap.
fn ray_around(gap: vec2<u32>, index: u32) -> vec2<u32> {
    let rays = (view.size + SPACING - 1u) / SPACING;
    return min(gap + vec2(index & 1u, index >> 1u), rays - 1u);
}

// Returns the list of a prop's pixels at edges: props of a field share one. `part` is 1 for pixels that a prop owns where
// another one may be before it, and 0 for all others.
fn list_of(prop: u32, part: u32) -> u32 {
    return part * view.edge_lists + (props[prop].field & (view.edge_lists - 1u));
}

// Returns the numbers of batches along each axis.
fn batches() -> vec2<u32> {
    return (view.size + BATCH - 1u) / BATCH;
}

// Returns the batch of a pixel in a list. Gaps have one list.
fn batch_of(pixel: vec2<u32>, list: u32) -> u32 {
    let all = batches();
    let square = pixel / BATCH;
    return (list * all.y + square.y) * all.x + square.x;
}

// Returns the pixel within the square of a batch in which the element `index` of the batch is drawn: along the Z-order
// curve, so that neighbors are marched together, and as few blocks of pixels as possible are drawn.
fn place_in_batch(index: u32) -> vec2<u32> {
    var bits = vec2(index, index >> 1u) & vec2(0x155u);
    bits = (bits | (bits >> vec2(1u))) & vec2(0x133u);
    bits = (bits | (bits >> vec2(2u))) & vec2(0x10fu);
    return (bits | (bits >> vec2(4u))) & vec2(0x1fu);
}

// Returns the element that is drawn in a pixel within the square of a batch.
fn index_in_batch(place: vec2<u32>) -> u32 {
    var bits = (place | (place << vec2(4u))) & vec2(0x10fu);
    bits = (bits | (bits << vec2(2u))) & vec2(0x133u);
    bits = (bits | (bits << vec2(1u))) & vec2(0x155u);
    return bits.x | (bits.y << 1u);
}

// Returns the width and the height, in pixels, of the part of a square in which `count` elements are drawn.
fn size_of_batch(count: u32) -> vec2<u32> {
    let bits = 32u - countLeadingZeros(count - 1u);
    return vec2(1u << ((bits + 1u) / 2u), 1u << (bits / 2u));
}
