// The octree, in bind group 1, and its traversal along rays. `src/gpu/records.rs` creates the records.
#define_import_path bevy_plenoctree::octree

#import bevy_plenoctree::constants::{BRICK, INNER, KIND, NO_LEAF, WHOLE}

struct Field {
    // The depth of the tree.
    depth: u32,
    // The level whose cells the table lists.
    table_level: u32,
    // The base-2 logarithm of the width of textures.
    row: u32,
    // The base-2 logarithms of the numbers of rows in a layer of each texture.
    record_rows: u32,
    density_rows: u32,
    coefficient_rows: u32,
    codebook_rows: u32,
    // For packed fields: the first texel of the rows of differences, the step of colors, and the value of the largest
    // coefficient of a row.
    chroma: u32,
    color_step: f32,
    table_scale: f32,
}

@group(1) @binding(0) var<uniform> field: Field;
@group(1) @binding(1) var table: texture_2d_array<u32>;
#ifdef INNER_RECORDS
@group(1) @binding(2) var records: texture_2d_array<u32>;
#endif
@group(1) @binding(3) var densities: texture_2d_array<f32>;

// Returns the column, the row and the layer of an element of an array.
fn place(index: u32, rows: u32) -> vec3<u32> {
    let row = index >> field.row;
    return vec3(index & ((1u << field.row) - 1u), row & ((1u << rows) - 1u), row >> rows);
}

// A ray, in units of finest cells. `t` is in world units of the field.
struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    // 1 where the direction is not negative, otherwise 0.
    forward: vec3<i32>,
}

struct Walk {
    // A position in the next cell to visit, in finest cells.
    position: vec3<i32>,
    t: f32,
}

// A leaf that a ray crosses, and where the ray enters and exits it. If these are the same, there is no leaf.
struct Crossing {
    leaf: u32,
    enter: f32,
    exit: f32,
}

fn make_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    // Along an axis where its direction is 0, a ray crosses no faces. Replace 0 with a value that is too small to reach
    // a face, but safe to divide by.
    let safe = select(direction, vec3(1e-20), abs(direction) < vec3(1e-20));
    return Ray(origin, safe, 1.0 / safe, vec3<i32>(safe > vec3(0.0)));
}

// Returns where a ray enters and exits a box. The entry is no less than `least`.
fn clip(ray: Ray, low: vec3<f32>, high: vec3<f32>, least: f32) -> vec2<f32> {
    let a = (low - ray.origin) * ray.inverse;
    let b = (high - ray.origin) * ray.inverse;
    let enter = min(a, b);
    let leave = max(a, b);
    return vec2(max(max(max(enter.x, enter.y), enter.z), least), min(min(leave.x, leave.y), leave.z));
}

fn begin(ray: Ray, t: f32) -> Walk {
    let last = (1i << field.depth) - 1;
    return Walk(clamp(vec3<i32>(floor(ray.origin + t * ray.direction)), vec3(0), vec3(last)), t);
}

fn is_inside(walk: Walk) -> bool {
    return all(vec3<u32>(walk.position) < vec3(1u << field.depth));
}

// Moves through the cell of `size` at `low` to the neighbor across the face where the ray exits. Positions are
// integers, so that no cell is missed or visited twice, no matter how short the path through it.
fn leave(ray: Ray, walk: Walk, low: vec3<i32>, size: i32) -> Walk {
    let planes = (vec3<f32>(low + size * ray.forward) - ray.origin) * ray.inverse;
    let exit = max(min(min(planes.x, planes.y), planes.z), walk.t);
    let next = clamp(vec3<i32>(floor(ray.origin + exit * ray.direction)), low, low + size - 1);
    let beyond = low - 1 + ray.forward * (size + 1);
    return Walk(select(next, beyond, planes <= vec3(exit)), exit);
}

// Counts the bits set before bit `index` (below 64).
fn count_before(record: vec4<u32>, index: u32) -> u32 {
    let below = (1u << (index & 31u)) - 1u;
    return select(countOneBits(record.x & below), countOneBits(record.x) + countOneBits(record.y & below), index >= 32u);
}

struct Cell {
    leaf: u32,
    // The base-2 logarithm of its width, in finest cells.
    shift: u32,
}

// Returns the cell that contains a finest cell.
fn locate(position: vec3<u32>) -> Cell {
    var shift = field.depth - field.table_level;
    let entry = position >> vec3(shift);
    var record = textureLoad(table, entry.zy, entry.x, 0);
#ifdef INNER_RECORDS
    loop {
        if (record.w & KIND) != INNER {
            break;
        }
        shift -= 2u;
        let part = part_at(position, shift);
        let octant = (select(record.x, record.y, part >= 32u) >> (part & 24u)) & 255u;
        if ((octant >> (part & 7u)) & 1u) == 0u {
            // An empty part has no record. Create one that holds its level.
            record = vec4(0u, 0u, 0u, field.depth - shift - select(0u, 1u, octant == 0u));
        } else {
            let index = record.z + count_before(record, part);
            let at = place(index, field.record_rows);
            record = textureLoad(records, at.xy, at.z, 0);
        }
    }
#endif
    let kind = record.w & KIND;
    let part = part_at(position, 0u);
    let octant = (select(record.x, record.y, part >= 32u) >> (part & 24u)) & 255u;
    let merged = ((record.w >> (part >> 3u)) & 1u) != 0u;
    let first = select(part, part & 56u, merged);
    let is_brick = kind == BRICK;
    let in_brick = record.z + count_before(record, first);
    let leaf_in_brick = select(NO_LEAF, in_brick, ((octant >> (first & 7u)) & 1u) != 0u);
    let leaf_alone = select(NO_LEAF, record.z, kind == WHOLE);
    return Cell(
        select(leaf_alone, leaf_in_brick, is_brick),
        select(field.depth - (record.w & 31u), select(0u, 1u, merged || octant == 0u), is_brick),
    );
}

// Returns which of the 64 parts of a record contains a finest cell, if parts are 2^shift finest cells wide.
fn part_at(position: vec3<u32>, shift: u32) -> u32 {
    let q = position >> vec3(shift);
    let high = (q >> vec3(1u)) & vec3(1u);
    let low = q & vec3(1u);
    return 32u * high.x + 16u * high.y + 8u * high.z + 4u * low.x + 2u * low.y + low.z;
}

// Returns whether there are no leaves left before `end`.
fn has_ended(walk: Walk, end: f32) -> bool {
    return walk.t >= end || !is_inside(walk);
}

// How many cells a lane visits in search of a leaf while others wait.
const PATIENCE: u32 = 8u;

// Returns the next leaf before `end`, if it is near. Lanes that have found a leaf wait here for the others, so that
// most lanes shade leaves at once.
fn next_leaf(ray: Ray, walk: ptr<function, Walk>, end: f32) -> Crossing {
    var crossing = Crossing(NO_LEAF, 0.0, 0.0);
    var visited = 0u;
    // Test the condition first. Mesa's software rasterizer mixes up the values of different lanes after a loop that
    // tests it at the end.
    loop {
        if crossing.leaf != NO_LEAF || visited == PATIENCE || has_ended(*walk, end) {
            break;
        }
        visited += 1u;
        let cell = locate(vec3<u32>((*walk).position));
        let size = 1i << cell.shift;
        let enter = (*walk).t;
        *walk = leave(ray, *walk, (*walk).position & vec3(-size), size);
        crossing = Crossing(cell.leaf, enter, min((*walk).t, end));
    }
    if crossing.leaf == NO_LEAF {
        return Crossing(0u, (*walk).t, (*walk).t);
    }
    return crossing;
}

fn density(leaf: u32) -> f32 {
    let at = place(leaf, field.density_rows);
    return textureLoad(densities, at.xy, at.z, 0).x;
}
