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
    // For packed fields: the first texels of the rows of luma and of differences in the codebook, the step of colors, and
    // the value of the largest coefficient of a row.
    luma: u32,
    chroma: u32,
    color_step: f32,
    table_scale: f32,
}

@group(1) @binding(0) var<uniform> field: Field;
@group(1) @binding(1) var table: texture_2d_array<u32>;
#ifdef INNER_LEVELS
@group(1) @binding(2) var records: texture_2d_array<u32>;
#endif
// The density of every leaf or, with a CODEBOOK, its index among those with which the codebook begins.
@group(1) @binding(3) var densities: texture_2d_array<u32>;
#ifdef CODEBOOK
@group(1) @binding(5) var codebook: texture_2d_array<u32>;
#endif

// Returns the column, the row and the layer of an element of an array.
fn place(index: u32, rows: u32) -> vec3<u32> {
    let row = index >> field.row;
    return vec3(index & ((1u << field.row) - 1u), row & ((1u << rows) - 1u), row >> rows);
}

#ifdef INNER_LEVELS
fn child_record(index: u32) -> vec4<u32> {
    let at = place(index, field.record_rows);
    return textureLoad(records, at.xy, at.z, 0);
}
#endif

// A ray, in units of finest cells. `t` is in world units of the field. Along axes where it moves toward lower
// coordinates, these count from the opposite face of the field instead, so that every ray moves forward.
struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    // The bits that turn coordinates of cells into those of the field, and back.
    mirror: vec3<i32>,
    // The depth of the tree, and how many levels of it are below the table.
    depth: u32,
    table_shift: u32,
}

struct Walk {
    // A position in the next cell to visit, in finest cells, counted as the ray counts them.
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
    let cells = 1i << field.depth;
    let is_forward = safe > vec3(0.0);
    return Ray(
        select(f32(cells) - origin, origin, is_forward),
        abs(safe),
        1.0 / abs(safe),
        select(vec3(cells - 1), vec3(0), is_forward),
        field.depth,
        field.depth - field.table_level,
    );
}

// Returns where a ray enters and exits a box. If it begins inside, it enters at 0.
fn clip(ray: Ray, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let cells = vec3(f32(1u << ray.depth));
    let is_forward = ray.mirror == vec3(0);
    let enter = (select(cells - high, low, is_forward) - ray.origin) * ray.inverse;
    let leave = (select(cells - low, high, is_forward) - ray.origin) * ray.inverse;
    return vec2(max(max(max(enter.x, enter.y), enter.z), 0.0), min(min(leave.x, leave.y), leave.z));
}

fn begin(ray: Ray, t: f32) -> Walk {
    let last = (1i << ray.depth) - 1;
    return Walk(clamp(vec3<i32>(floor(ray.origin + t * ray.direction)), vec3(0), vec3(last)), t);
}

fn is_inside(ray: Ray, walk: Walk) -> bool {
    return ((walk.position.x | walk.position.y | walk.position.z) >> ray.depth) == 0;
}

// Moves to the neighbor of a box across the face where the ray exits. `far` is the last finest cell of the box in the
// direction of the ray. Positions are integers, so that no cell is missed or visited twice, no matter how short the
// path through it. A ray that is not a number leaves, too: it would never end.
fn leave(ray: Ray, walk: Walk, far: vec3<i32>) -> Walk {
    let beyond = far + 1;
    let planes = (vec3<f32>(beyond) - ray.origin) * ray.inverse;
    let exit = max(min(min(planes.x, planes.y), planes.z), walk.t);
    let next = clamp(vec3<i32>(ray.origin + exit * ray.direction), walk.position, far);
    return Walk(select(beyond, next, planes > vec3(exit)), exit);
}

// Returns the bits of a record that are set before bit `index` (below 64).
fn bits_before(record: vec4<u32>, index: u32) -> vec2<u32> {
    let below = (1u << (index & 31u)) - 1u;
    return select(vec2(record.x & below, 0u), vec2(record.x, record.y & below), index >= 32u);
}

fn count(bits: vec2<u32>) -> u32 {
    let ones = countOneBits(bits);
    return ones.x + ones.y;
}

struct Cell {
    // The leaf, if the number of `bits` is added to it, or NO_LEAF, for which `bits` are meaningless.
    leaf: u32,
    bits: vec2<u32>,
    // The last finest cell of the cell, or of an empty box around it, in the direction of the ray.
    far: vec3<i32>,
}

// One of the 64 parts of a record: the bit that says whether it has content, whether it has, and whether it is all of its
// octant.
struct Part {
    bit: u32,
    is_filled: bool,
    is_octant: bool,
}

// Returns the part of a record in which a finest cell is, if parts are 2^shift finest cells wide.
fn part_of(record: vec4<u32>, position: vec3<u32>, shift: u32) -> Part {
    let part = part_at(position, shift);
    let octant = (select(record.x, record.y, part >= 32u) >> (part & 24u)) & 255u;
    let is_merged = ((record.w >> (part >> 3u)) & 1u) != 0u;
    let bit = select(part, part & 56u, is_merged);
    return Part(bit, ((octant >> (bit & 7u)) & 1u) != 0u, is_merged || octant == 0u);
}

// Returns the cell at a position along a ray.
fn locate(ray: Ray, along: vec3<i32>) -> Cell {
    let position = vec3<u32>(along ^ ray.mirror);
    let entry = position >> vec3(ray.table_shift);
    var record = textureLoad(table, entry.zy, entry.x, 0);
#ifdef INNER_LEVELS
    // A loop that ends with the number of levels costs less than one that ends for each lane by itself.
    for (var level = 1u; level <= #{INNER_LEVELS}u; level++) {
        if (record.w & KIND) == INNER {
            let shift = ray.table_shift - 2u * level;
            let part = part_of(record, position, shift);
            // An empty part has no record. Create one that holds its level.
            let empty = vec4(0u, 0u, 0u, ray.depth - shift - select(0u, 1u, part.is_octant));
            let before = select(0u, count(bits_before(record, part.bit)), part.is_filled);
            record = select(empty, child_record(record.z + before), part.is_filled);
        }
    }
#endif
    let kind = record.w & KIND;
    let part = part_of(record, position, 0u);
    let is_brick = kind == BRICK;
    let is_leaf = select(kind == WHOLE, part.is_filled, is_brick);
    let size = select(ray.depth - (record.w & 31u), select(0u, 1u, part.is_octant), is_brick);
    let extents = (select(record.yyy, record.xxx, ray.mirror != vec3(0)) >> vec3(0u, 10u, 20u)) & vec3(1023u);
    let more = select(extents << vec3(ray.table_shift), vec3(0u), is_brick);
    return Cell(
        select(NO_LEAF, record.z, is_leaf),
        bits_before(record, part.bit),
        (along | vec3((1i << size) - 1)) + vec3<i32>(more),
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
fn has_ended(ray: Ray, walk: Walk, end: f32) -> bool {
    return walk.t >= end || !is_inside(ray, walk);
}

// How many cells a lane visits in search of a leaf while others wait.
const PATIENCE: u32 = 4u;

// Returns the next leaf before `end`, if it is near. Lanes that have found a leaf wait here for the others, so that
// most lanes shade leaves at once.
fn next_leaf(ray: Ray, walk: ptr<function, Walk>, end: f32) -> Crossing {
    var crossing = Crossing(NO_LEAF, 0.0, 0.0);
    var bits = vec2(0u);
    var visited = 0u;
    // Test the condition first. Mesa's software rasterizer mixes up the values of different lanes after a loop that
    // tests it at the end.
    loop {
        if crossing.leaf != NO_LEAF || visited == PATIENCE || has_ended(ray, *walk, end) {
            break;
        }
        visited += 1u;
        let cell = locate(ray, (*walk).position);
        let enter = (*walk).t;
        *walk = leave(ray, *walk, cell.far);
        crossing = Crossing(cell.leaf, enter, min((*walk).t, end));
        bits = cell.bits;
    }
    if crossing.leaf == NO_LEAF {
        return Crossing(0u, (*walk).t, (*walk).t);
    }
    // Counting takes longer than what the loop does with these bits.
    crossing.leaf += count(bits);
    return crossing;
}

fn density(leaf: u32) -> f32 {
    let at = place(leaf, field.density_rows);
    let found = textureLoad(densities, at.xy, at.z, 0).x;
#ifdef CODEBOOK
    let pair = textureLoad(codebook, vec2(found >> 1u, 0u), 0, 0).xy;
    return bitcast<f32>(select(pair.x, pair.y, (found & 1u) != 0u));
#else
    return bitcast<f32>(found);
#endif
}

// Returns the share of light that an optical depth absorbs: 1 - exp(-depth), without the cancellation that would erase
// thin fog.
fn absorbed(depth: f32) -> f32 {
    let series = depth * (1.0 - 0.5 * depth * (1.0 - depth / 3.0 * (1.0 - 0.25 * depth)));
    return select(1.0 - exp(-depth), series, depth < 0.02);
}
