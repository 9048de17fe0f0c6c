// The ray of a pixel into a prop, for the passes that march.
#define_import_path bevy_plenoctree::prop_ray

#import bevy_plenoctree::octree::{Crossing, Ray, clip, field, make_ray}
#ifndef SHADOW_MAP
#import bevy_plenoctree::scene::scene_distance
#endif
#import bevy_plenoctree::view::{LEAST_SOLID_DEPTH, depth_value, props, view, view_distance}

// What `box.wgsl` passes to fragments.
struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) prop: u32,
    // The part of the ray to draw, in the volume pass.
    @location(1) @interpolate(flat) part: u32,
}

struct PropRay {
    ray: Ray,
    // The direction in world units of the field, normalized.
    unit: vec3<f32>,
    // World units of the field per unit along the view axis.
    length: f32,
    // Where the ray enters the box around the leaves, and where it leaves the box or reaches the scene.
    span: vec2<f32>,
}

fn prop_ray(in: Varying) -> PropRay {
    let at = in.position.xy * view.pixel;
    let point = vec3(1.0, at - props[in.prop].reference);
    let cells = f32(1u << field.depth);
    let toward = props[in.prop].direction * point;
    let length = length(toward);
    let unit = toward / length;
    let ray = make_ray(props[in.prop].origin * point * cells, unit * props[in.prop].scale * cells);

    let span = clip(ray, props[in.prop].low * cells, props[in.prop].high * cells, 0.0);
#ifdef SHADOW_MAP
    return PropRay(ray, unit, length, span);
#else
    let end = min(span.y, (scene_distance(vec2<u32>(at)) - props[in.prop].near) * length);
    return PropRay(ray, unit, length, vec2(span.x, end));
#endif
}

// Returns where the ray reaches a value of the depth buffer.
fn position_at(in: PropRay, prop: u32, depth: f32) -> f32 {
    return (view_distance(depth) - props[prop].near) * in.length;
}

// Returns where transmittance, which is `before` where the ray enters a leaf, falls to `limit`.
fn position_of(limit: f32, before: f32, crossing: Crossing, sigma: f32) -> f32 {
    return crossing.enter + max(log(before / limit), 0.0) / sigma;
}

// Returns the value of the depth buffer where the ray becomes solid.
fn solid_depth_at(in: PropRay, prop: u32, solid: f32) -> f32 {
    return clamp(depth_value(props[prop].near + solid / in.length), LEAST_SOLID_DEPTH, 1.0);
}
