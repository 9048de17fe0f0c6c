// Adds the visibility-weighted radiance samples of a slice of leaves to histograms. See section 3 of the method, steps
// 2 to 5. Each thread handles one leaf and one cell of directions. Neighboring threads of a workgroup handle
// neighboring leaves.

#import bevy_plenoctree::constants::{MAX_CHANNEL, MAX_DEPTH, SAMPLING_WORKGROUP}
#import bevy_plenoctree::octree::{begin, density, field, has_ended, make_ray, next_leaf}
#import bevy_plenoctree::radiance::{harmonics, radiance}

struct Slice {
    // Tree units per world unit of the field.
    frame_scale: vec3<f32>,
    leaves: u32,
    rays_per_cell: u32,
    fine_bins: u32,
    coarse_bins: u32,
    // The optical depth above which a leaf is hidden.
    limit: f32,
    // The factor that converts weights to integers.
    weight_scale: f32,
    // 1 if rays start where they enter a leaf, and 0 if they start at its center.
    at_entry: u32,
    // The lowest corner of the lattice, in finest cells, and its size.
    lattice_low: vec3<i32>,
    lattice_size: vec3<i32>,
}

@group(0) @binding(0) var<uniform> slice: Slice;
// Twice the center of each leaf of the slice, in cells of a tree of depth MAX_DEPTH, and the index of the leaf.
@group(0) @binding(1) var<storage, read> leaves: array<vec4<u32>>;
// Unit vectors toward the observers. Those of one cell of directions are next to each other.
@group(0) @binding(2) var<storage, read> observers: array<vec4<f32>>;
// The fine bins, then the coarse bins, two words each, with the low word first. Integer sums do not depend on the order
// of addition.
@group(0) @binding(3) var<storage, read_write> bins: array<atomic<u32>>;
#ifdef LATTICE
// The finest cells of the field, a word each: its density and, in the low four bits, the base-2 logarithm of the width
// of the octree's cell around it.
@group(0) @binding(4) var<storage, read> lattice: array<u32>;
const SIZE_BITS: u32 = 15u;
#endif

// No ray is this long.
const FAR: f32 = 1e30;

const WORD: f32 = 4294967296.0;

fn add(bin: u32, weight: f32) {
    let scaled = weight * slice.weight_scale;
    let high = floor(scaled / WORD);
    let low = u32(scaled - high * WORD);
    let before = atomicAdd(&bins[2u * bin], low);
    let carry = select(0u, 1u, before + low < before);
    let above = u32(high) + carry;
    if above > 0u {
        atomicAdd(&bins[2u * bin + 1u], above);
    }
}

fn bin_of(color: vec3<f32>, count: u32) -> u32 {
    let bin = vec3<u32>(clamp(color, vec3(0.0), vec3(MAX_CHANNEL)) * f32(count));
    return (bin.r * count + bin.g) * count + bin.b;
}

// What a leaf's light crosses on its way to an observer.
struct Passage {
    // If rays start where they enter a leaf, the length of the path between its center and its border, in world units.
    own: f32,
    // The optical depth from the sampled point of the leaf to the edge of the field.
    total: f32,
}

// Adds a path of a length and an optical depth.
fn extend(passage: ptr<function, Passage>, path: f32, depth: f32, is_own: bool) {
    (*passage).own += select(0.0, path, is_own);
    (*passage).total += select(depth, 0.0, is_own);
}

// Follows a ray from the center of a leaf to the edge of the field. Stops soon after the total exceeds the limit.
fn passage(center: vec3<f32>, observer: vec3<f32>) -> Passage {
    let ray = make_ray(center, observer * slice.frame_scale * f32(1u << field.depth));
    var passage = Passage(0.0, 0.0);
    // The leaf that a ray crosses first is its own.
    var is_own = slice.at_entry == 1u;
#ifdef LATTICE
    // The ray counts cells in its own direction, so words may be in reverse order along an axis.
    let rows = vec3(slice.lattice_size.y * slice.lattice_size.z, slice.lattice_size.z, 1);
    let is_forward = ray.mirror == vec3(0);
    let steps = select(-rows, rows, is_forward);
    let first = dot(ray.mirror - slice.lattice_low, rows);
    let high = slice.lattice_low + slice.lattice_size;
    let end = select(ray.mirror + 1 - slice.lattice_low, high, is_forward);
    var cell = vec3<i32>(ray.origin);
    var enter = 0.0;
    while passage.total <= slice.limit && all(cell < end) {
        let word = lattice[first + dot(cell, steps)];
        let beyond = (cell | vec3((1i << (word & SIZE_BITS)) - 1)) + 1;
        let planes = (vec3<f32>(beyond) - ray.origin) * ray.inverse;
        let exit = max(min(min(planes.x, planes.y), planes.z), enter);
        let next = max(vec3<i32>(ray.origin + exit * ray.direction), cell);
        cell = select(beyond, next, planes > vec3(exit));
        extend(&passage, exit - enter, bitcast<f32>(word & ~SIZE_BITS) * (exit - enter), is_own);
        enter = exit;
        is_own = false;
    }
#else
    var walk = begin(ray, 0.0);
    while passage.total <= slice.limit && !has_ended(ray, walk, FAR) {
        let crossing = next_leaf(ray, &walk, FAR);
        let path = crossing.exit - crossing.enter;
        extend(&passage, path, density(crossing.leaf) * path, is_own);
        is_own = false;
    }
#endif
    return passage;
}

// Returns the mean of density times transmittance along a path through a leaf, which is finite even where the optical
// depth is not.
fn mean_weight(leaf_density: f32, path: f32) -> f32 {
    let depth = min(leaf_density * path, 100.0);
    if depth < 0.02 {
        // The difference from 1 would lose its digits.
        return leaf_density * (1.0 - depth / 2.0 + depth * depth / 6.0);
    }
    return (1.0 - exp(-depth)) / path;
}

@compute @workgroup_size(SAMPLING_WORKGROUP)
fn sample(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= slice.leaves {
        return;
    }
    let entry = leaves[id.x];
    let at_entry = slice.at_entry == 1u;
    let leaf_density = density(entry.w);
    let center = vec3<f32>(entry.xyz) * (f32(1u << field.depth) / f32(2u << MAX_DEPTH));
    // Average colors as differences from the first one. A color that is the same from all directions then stays exactly
    // the same, even on the border between two bins.
    var first = vec3(0.0);
    var color = vec3(0.0);
    var visible = 0.0;
    for (var ray = 0u; ray < slice.rays_per_cell; ray++) {
        let observer = observers[id.y * slice.rays_per_cell + ray].xyz;
        let passage = passage(center, observer);
        if passage.total <= slice.limit {
            // At the center, the density is the same for all rays, and multiplies their sum.
            var weight = exp(-passage.total);
            if at_entry {
                weight *= mean_weight(leaf_density, 2.0 * passage.own);
            }
            var h = harmonics(-observer);
            let seen = radiance(entry.w, &h);
            if visible == 0.0 {
                first = seen;
            }
            color += weight * (seen - first);
            visible += weight;
        }
    }
    if visible > 0.0 {
        let weight = select(leaf_density, 1.0, at_entry) * visible / f32(slice.rays_per_cell);
        let mean = first + color / visible;
        let fine = slice.fine_bins * slice.fine_bins * slice.fine_bins;
        add(bin_of(mean, slice.fine_bins), weight);
        add(fine + bin_of(mean, slice.coarse_bins), weight);
    }
}
