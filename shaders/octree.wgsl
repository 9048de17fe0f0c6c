// The octree and a ray's way through it: bind group 1.
#define_import_path bevy_plenoctree::octree

struct Field {
    // Levels of cells.
    depth: u32,
    // Leaves whose coefficients are in one binding.
    leaves_per_part: u32,
}

@group(1) @binding(0) var<uniform> field: Field;
// Eight cells a node. 0 is empty, the high bit marks a leaf, the rest is an index.
@group(1) @binding(1) var<storage, read> nodes: array<u32>;
@group(1) @binding(2) var<storage, read> densities: array<f32>;

const LEAF: u32 = 0x80000000u;

// A ray in finest cells. `t` is measured in world units of the field.
struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    // 1 where the direction is not negative, else 0.
    forward: vec3<i32>,
}

struct Walk {
    // The cell that the walk is about to visit, in finest cells.
    position: vec3<i32>,
    t: f32,
}

struct Step {
    // The cell's word in `nodes`.
    cell: u32,
    // Where the ray leaves the cell.
    exit: f32,
}

fn make_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    // A component of zero crosses no face: it is made too small to reach one, but not to divide by.
    let safe = select(direction, vec3(1e-20), abs(direction) < vec3(1e-20));
    return Ray(origin, safe, 1.0 / safe, vec3<i32>(safe > vec3(0.0)));
}

// Where the ray enters and leaves a box, both at least 0.
fn clip(ray: Ray, low: vec3<f32>, high: vec3<f32>) -> vec2<f32> {
    let a = (low - ray.origin) * ray.inverse;
    let b = (high - ray.origin) * ray.inverse;
    let enter = min(a, b);
    let leave = max(a, b);
    return vec2(max(max(max(enter.x, enter.y), enter.z), 0.0), min(min(leave.x, leave.y), leave.z));
}

fn begin(ray: Ray, t: f32) -> Walk {
    let last = (1i << field.depth) - 1;
    return Walk(clamp(vec3<i32>(floor(ray.origin + t * ray.direction)), vec3(0), vec3(last)), t);
}

// Visits one cell and moves on to the neighbour behind the face through which the ray leaves. Positions are integers, so
// that no cell is lost or visited twice, however short the way through it.
fn advance(ray: Ray, walk: ptr<function, Walk>) -> Step {
    let position = (*walk).position;
    var level = field.depth;
    var node = 0u;
    var cell = 0u;
    loop {
        level -= 1u;
        let part = (vec3<u32>(position) >> vec3(level)) & vec3(1u);
        cell = nodes[8u * node + 4u * part.x + 2u * part.y + part.z];
        if cell == 0u || (cell & LEAF) != 0u || level == 0u {
            break;
        }
        node = cell;
    }
    let size = 1i << level;
    let low = position & vec3(-size);
    let planes = (vec3<f32>(low + size * ray.forward) - ray.origin) * ray.inverse;
    let exit = max(min(min(planes.x, planes.y), planes.z), (*walk).t);

    var next = clamp(vec3<i32>(floor(ray.origin + exit * ray.direction)), low, low + size - 1);
    let beyond = low - 1 + ray.forward * (size + 1);
    if planes.x <= planes.y && planes.x <= planes.z {
        next.x = beyond.x;
    } else if planes.y <= planes.z {
        next.y = beyond.y;
    } else {
        next.z = beyond.z;
    }
    *walk = Walk(next, exit);
    return Step(cell, exit);
}

fn is_inside(walk: Walk) -> bool {
    let cells = 1i << field.depth;
    return all(walk.position >= vec3(0)) && all(walk.position < vec3(cells));
}
