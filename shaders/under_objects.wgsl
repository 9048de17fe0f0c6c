// Writes what transparent objects are blended over: the target, with the props.

#import bevy_plenoctree::view::{is_drawn, is_solid, scene_depth_at, share_before, view}

// It has the size of what is written.
@group(1) @binding(0) var scene: texture_2d<f32>;
// The depth of the props.
@group(1) @binding(1) var depth: texture_depth_2d;

struct Varying {
    @builtin(position) position: vec4<f32>,
#ifdef MULTISAMPLED
    @builtin(sample_index) sample: u32,
#endif
}

#ifdef MULTISAMPLED
// What the target holds. In Oklab, channels may be negative.
#ifdef FLOATS
const LEAST: f32 = -65504.0;
const MOST: f32 = 65504.0;
#else
const LEAST: f32 = 0.0;
const MOST: f32 = 1.0;
#endif

// Returns what a sample shows. At the edges of meshes before props, samples of the mesh keep what is in the target from
// the objects behind it, and the others show what the prop shows beside the edge. Their mean is what the target shows.
fn shown_at(pixel: vec2<u32>, sample: u32, target_color: vec4<f32>) -> vec4<f32> {
    var beside = vec4(0.0);
    var props = 0.0;
    var count = 0.0;
    for (var i = 0; i < 9; i++) {
        let at = vec2<u32>(vec2<i32>(pixel) + vec2(i % 3 - 1, i / 3 - 1));
        if is_drawn(at) {
            let solid = textureLoad(depth, at, 0);
            if is_solid(solid) && share_before(at, solid) == 0.0 {
                beside += textureLoad(scene, at + view.corner, 0);
                props += solid;
                count += 1.0;
            }
        }
    }
    if count == 0.0 {
        return target_color;
    }
    let prop = beside / count;
    let share = share_before(pixel, props / count);
    if share == 0.0 || share == 1.0 {
        return target_color;
    }
    // What does not fit in the target is left to the prop, which then fits: both are shares of one color that does.
    let mesh = clamp((target_color - (1.0 - share) * prop) / share, vec4(LEAST), vec4(MOST));
    let is_mesh = scene_depth_at(pixel, sample) > props / count;
    return select((target_color - share * mesh) / (1.0 - share), mesh, is_mesh);
}
#endif

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let at = vec2<u32>(in.position.xy);
    let color = textureLoad(scene, at, 0);
#ifdef MULTISAMPLED
    return shown_at(at - view.corner, in.sample, color);
#else
    return color;
#endif
}
