// What parallel rays see of a field, from all directions from which it is sampled. See section 3 of the method, step 11.
// `View::all` of the crate `plenoctree` does the same on the CPU.

#import bevy_plenoctree::octree::{absorbed, begin, clip, density, field, has_ended, make_ray, next_leaf}
#import bevy_plenoctree::radiance::{harmonics, radiance}

// The rays of a view, in finest cells of the field.
struct Rays {
    // The origin of the first ray, and the steps to the next one of a row and to the next row.
    first: vec3<f32>,
    right: vec3<f32>,
    down: vec3<f32>,
    // Per world unit of the field.
    direction: vec3<f32>,
    // The same, as a unit vector in the field's frame.
    unit: vec3<f32>,
}

@group(0) @binding(0) var<storage, read> views: array<Rays>;
// The colors that rays see, view by view and row by row, and the depth at which each becomes half opaque or, where it
// does not, its opacity times -1.
@group(0) @binding(1) var<storage, read_write> seen: array<vec4<f32>>;

// Transmittance below which a ray ends.
const OPAQUE: f32 = 1e-2;
// Transmittance below which a ray sees a surface.
const SURFACE: f32 = 0.5;

@compute @workgroup_size(8, 8)
fn see(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>) {
    let rays = views[id.z];
    let ray = make_ray(rays.first + f32(id.x) * rays.right + f32(id.y) * rays.down, rays.direction);
    let span = clip(ray, vec3(0.0), vec3(f32(1u << field.depth)));
    var h = harmonics(rays.unit);
    var color = vec3(0.0);
    var opacity = 0.0;
    var transmittance = 1.0;
    var depth = -1.0;
    var walk = begin(ray, span.x);
    loop {
        if transmittance < OPAQUE || span.x >= span.y || has_ended(ray, walk, span.y) {
            break;
        }
        let crossing = next_leaf(ray, &walk, span.y);
        let passed = density(crossing.leaf) * (crossing.exit - crossing.enter);
        let weight = transmittance * absorbed(passed);
        color += weight * radiance(crossing.leaf, &h);
        opacity += weight;
        transmittance *= exp(-passed);
        depth = select(depth, crossing.enter, depth < 0.0 && transmittance < SURFACE);
    }
    let row = (id.z * 8u * workgroups.y + id.y) * 8u * workgroups.x;
    seen[row + id.x] = vec4(color / max(opacity, 1e-20), select(-opacity, max(depth, 1e-30), depth >= 0.0));
}
