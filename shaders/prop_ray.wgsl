// The ray of a pixel into a prop, for the passes that march.
#define_import_path bevy_plenoctree::prop_ray

#import bevy_plenoctree::batch::{
    BATCH, GAPS_ACROSS, NO_ELEMENT, PIXELS_OF_GAP, SPACING, batch_of, index_in_batch, place_of_element,
}
#import bevy_plenoctree::octree::{Crossing, Ray, begin, clip, density, field, has_ended, make_ray, next_leaf}
#import bevy_plenoctree::view::{Prop, distance_from_depth, props, scene_depth_at, solid_depth, view}

// What the vertex shaders of props pass to fragments.
struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) prop: u32,
    // The part of the ray to draw, in the volume pass.
    @location(1) @interpolate(flat) part: u32,
}

struct PropRay {
    // The point of the viewport, in pixels.
    at: vec2<f32>,
    ray: Ray,
    // The direction in world units of the field, normalized.
    unit: vec3<f32>,
    // World units of the field per unit along the view axis.
    length: f32,
    // Where the ray enters the box around the leaves, and where it leaves the box or reaches the scene.
    span: vec2<f32>,
}

fn prop_ray(in: Varying) -> PropRay {
    var pixel = vec2<u32>(in.position.xy) * view.spacing;
#ifdef BATCHED
    let place = vec2<u32>(in.position.xy);
    let index = index_in_batch(place % BATCH);
    let element = place_of_element(batch_of(place, 0u), index / PIXELS_OF_GAP);
    let gap = vec2(element % GAPS_ACROSS, element / GAPS_ACROSS % GAPS_ACROSS);
    // The first pixel is the ray of the grid.
    let pixel_of_gap = index % PIXELS_OF_GAP + 1u;
    let beyond = vec2(pixel_of_gap % SPACING, pixel_of_gap / SPACING);
    pixel = min((place / BATCH * GAPS_ACROSS + gap) * SPACING + beyond, view.size - 1u);
#endif
    var seen = ray_at(props[in.prop], vec2<f32>(pixel) + 0.5);
#ifndef SHADOW_MAP
    seen.span.y = min(seen.span.y, position_at(seen, in.prop, scene_depth_at(pixel, 0u)));
#endif
#ifdef BATCHED
    seen.span.y = select(seen.span.y, seen.span.x, element == NO_ELEMENT);
#endif
    return seen;
}

// Returns the length of a vector whose square may be too large or too small for a float.
fn any_length(vector: vec3<f32>) -> f32 {
    let most = max(max(abs(vector.x), abs(vector.y)), abs(vector.z));
    // A power of two, so that no digit is lost: rays whose directions are slightly too long take many more steps.
    let scale = bitcast<f32>(bitcast<u32>(max(most, 1e-37)) & 0x7f800000u);
    return scale * length(vector / scale);
}

// Returns the ray through a point of the viewport, as if there were nothing else in the scene.
fn ray_at(prop: Prop, at: vec2<f32>) -> PropRay {
    let point = vec3(1.0, at - prop.reference);
    let cells = f32(1u << field.depth);
    let toward = prop.direction * point;
    let length = any_length(toward);
    let unit = toward / length;
    let ray = make_ray(prop.origin * point * cells, unit * prop.scale * cells);
    return PropRay(at, ray, unit, length, clip(ray, prop.low * cells, prop.high * cells));
}

// Returns where the ray reaches a depth.
fn position_at(in: PropRay, prop: u32, depth: f32) -> f32 {
    return (distance_from_depth(depth) - props[prop].near) * in.length;
}

// Returns where transmittance, which is `before` where the ray enters a leaf, falls to `limit`.
fn position_of(limit: f32, before: f32, crossing: Crossing, sigma: f32) -> f32 {
    return crossing.enter + max(log(before / limit), 0.0) / sigma;
}

struct Solid {
    // Where the ray becomes solid. Negative if it does not.
    at: f32,
    // What is left where the march ends.
    transmittance: f32,
}

// Marches through densities alone, to `end` or until transmittance falls below `stop`. A ray is solid where
// transmittance falls to `limit`.
fn march_to_solid(in: PropRay, end: f32, limit: f32, stop: f32) -> Solid {
    var transmittance = 1.0;
    var solid = -1.0;
    var walk = begin(in.ray, in.span.x);
    loop {
        if transmittance < stop || has_ended(in.ray, walk, end) {
            break;
        }
        let crossing = next_leaf(in.ray, &walk, end);
        let sigma = density(crossing.leaf);
        let before = transmittance;
        transmittance *= exp(-sigma * (crossing.exit - crossing.enter));
        let inside = position_of(limit, before, crossing, sigma);
        solid = select(solid, inside, solid < 0.0 && transmittance <= limit);
    }
    return Solid(solid, transmittance);
}

// Returns the depth where the ray becomes solid.
fn solid_depth_at(in: PropRay, prop: u32, solid: f32) -> f32 {
    return solid_depth(prop, solid / in.length);
}
