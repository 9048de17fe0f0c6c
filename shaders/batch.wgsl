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
// The gaps along a side of that square.
const GAPS_ACROSS: u32 = BATCH / SPACING;
// The words that say which gaps, or which pixels at edges, of a square are in its batch: row by row, a bit each.
const WORDS_OF_GAPS: u32 = GAPS_ACROSS * GAPS_ACROSS / 32u;
const WORDS_OF_EDGES: u32 = BATCH * BATCH / 32u;
#ifdef BATCHED
const WORDS: u32 = WORDS_OF_GAPS;
#else
const WORDS: u32 = WORDS_OF_EDGES;
#endif

// What the check pass finds about a gap.
const AGREES: u32 = 0u;
const EMPTY: u32 = 1u;
const NEEDS_RAYS: u32 = 2u;

// The words of every batch, for the passes that march rays.
@group(0) @binding(8) var<storage, read> listed: array<u32>;

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

// Returns the place of a gap among those of its square.
fn place_of_gap(gap: vec2<u32>) -> u32 {
    return gap.y % GAPS_ACROSS * GAPS_ACROSS + gap.x % GAPS_ACROSS;
}

// Returns the number of elements of a batch.
fn count_of(batch: u32) -> u32 {
    var count = 0u;
    for (var word = 0u; word < WORDS; word++) {
        count += countOneBits(listed[batch * WORDS + word]);
    }
    return count;
}

const NO_ELEMENT: u32 = 0xffffffffu;

// Returns the place of an element of a batch among those of its square: that of the bit `index` of those that are set.
fn place_of_element(batch: u32, index: u32) -> u32 {
    var at = 0u;
    var word = listed[batch * WORDS];
    var rest = index;
    loop {
        let bits = countOneBits(word);
        if rest < bits || at + 1u == WORDS {
            break;
        }
        rest -= bits;
        at += 1u;
        word = listed[batch * WORDS + at];
    }
    let exists = rest < countOneBits(word);
    var bit = 0u;
    for (var half = 16u; half > 0u; half >>= 1u) {
        let below = countOneBits((word >> bit) & ((1u << half) - 1u));
        bit += select(0u, half, rest >= below);
        rest -= select(0u, below, rest >= below);
    }
    return select(NO_ELEMENT, 32u * at + bit, exists);
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
