// The coverage pass: marches several rays through each pixel at the edge of a posterized prop where opacity does not show
// enough, to find which part of the pixel the prop covers, and its color there.

#import bevy_plenoctree::batch::{BATCH, NO_ELEMENT, batch_of, index_in_batch, list_of, place_of_element}
#import bevy_plenoctree::color::{premultiplied_tinted, to_half}
#import bevy_plenoctree::edge::{
    FAINTEST, RAYS, neighbor, offset_of_four, ray_offset, rays_of, sample_of, thinned, word_at, word_of,
}
#import bevy_plenoctree::octree::{begin, density, field, has_ended, next_leaf}
#import bevy_plenoctree::prop_ray::{Varying, position_of, ray_at}
#import bevy_plenoctree::radiance::{Harmonics, harmonics, radiance}
#import bevy_plenoctree::view::{
    FAR_AWAY, Prop, distance_from_depth, is_in_haze, is_solid, nearest_drawn, owner_of, props, scene_depth_at,
    solid_depth_at_distance, view,
}

// The owners of pixels, from the outline pass.
@group(2) @binding(0) var outline: texture_2d<u32>;
@group(2) @binding(1) var owner: texture_2d<f32>;
@group(2) @binding(2) var depth: texture_depth_2d;
#ifdef OF_OTHERS
// Where the rays reach the owner of the pixel, as `place_of` says, and 0 for those that do not: eight half floats.
@group(2) @binding(3) var own_places: texture_2d<u32>;
#endif
// The bits of a pixel's rays, one per ray, in four bytes.
// r: those that the owner of the pixel covers. If there is no other owner, those that see its first color.
// g: those where the other owner is in front of what is seen at the center of the pixel.
// b: those that the other owner covers, or would cover if the owner of the pixel did not. If there is no other
// owner, those that see the second color.
// a: the samples of the scene, one bit per sample, where something else is in front of the prop.
@group(3) @binding(0) var<storage, read_write> coverage: array<u32>;
// What the rays in r and in b see, as in `Color`. 0 if there were no rays: see `estimate` of `edge_owners.wgsl`. If the
// pixel has no owner, `own_rays` is the result of `thinned`.
@group(3) @binding(1) var own_rays: texture_storage_2d<rgba16float, write>;
#ifdef OF_OWNERS
@group(3) @binding(2) var own_places: texture_storage_2d<rgba32uint, write>;
#else
@group(3) @binding(2) var other_rays: texture_storage_2d<rgba16float, write>;
#endif

// What a ray sees of a prop.
struct Look {
    // Whether its opacity reaches the one from which the prop is posterized, and at which distance along the view axis.
    is_covered: bool,
    distance: f32,
    // Encoded sRGB premultiplied by opacity, and opacity.
    color: vec4<f32>,
}

// Marches through a point of the view as the volume pass does, but stops earlier. Begins at `begins` or at the box, and
// ends at the depth `last`.
fn look(prop: Prop, at: vec2<f32>, begins: f32, last: f32, h: ptr<function, Harmonics>) -> Look {
    let seen = ray_at(prop, at);
    let end = min(seen.span.y, (distance_from_depth(last) - prop.near) * seen.length);
    // The transmittances at which a ray counts as covered, and at which it stops and counts as opaque.
    let limit = max(1.0 - prop.min_opacity, view.stop_transmittance);
    let stop = max(min(FAINTEST, limit), view.stop_transmittance);
    var transmittance = 1.0;
    var covered_at = -1.0;
    // The opacity of the leaves in each quarter of the opacity along the ray. The heaviest leaf of a quarter says its
    // color, so that rays load few colors.
    var quarters = vec4(0.0);
    var heaviest = vec4(0.0);
    var leaves = vec4(0u);
    var walk = begin(seen.ray, max(seen.span.x, begins));
    loop {
        if transmittance < stop || has_ended(seen.ray, walk, end) {
            break;
        }
        let crossing = next_leaf(seen.ray, &walk, end);
        let sigma = density(crossing.leaf);
        let before = transmittance;
        transmittance *= exp(-sigma * (crossing.exit - crossing.enter));
        let weight = before - transmittance;
        let is_here = vec4(u32(4.0 * (1.0 - 0.5 * (before + transmittance)))) == vec4(0u, 1u, 2u, 3u);
        let here = select(vec4(0.0), vec4(weight), is_here);
        quarters += here;
        leaves = select(leaves, vec4(crossing.leaf), here > heaviest);
        heaviest = max(heaviest, here);
        let inside = position_of(limit, before, crossing, sigma);
        covered_at = select(covered_at, inside, covered_at < 0.0 && transmittance <= limit);
    }
    let gone = select(1.0 - transmittance, 1.0, transmittance < stop);
    var color = vec4(0.0);
    for (var i = 0; i < 4; i++) {
        if quarters.x > 0.0 {
            color += quarters.x * vec4(radiance(leaves.x, h), 1.0);
        }
        quarters = quarters.yzwx;
        leaves = leaves.yzwx;
    }
    return Look(covered_at >= 0.0, prop.near + covered_at / seen.length, color * gone / max(color.a, 1e-6));
}

// Returns the slope of a surface along one axis, from its depth at a pixel and at two neighbors. At the edge of the
// surface, one of the differences is not its slope: it is greater, or has the opposite sign.
fn slope(before: f32, here: f32, after: f32) -> f32 {
    let first = here - before;
    let second = after - here;
    return select(0.0, select(second, first, abs(first) < abs(second)), first * second > 0.0);
}

#ifndef MULTISAMPLED
// Returns how the scene's depth changes from pixel to pixel. Depths of planes are linear in pixels.
fn scene_slope(pixel: vec2<i32>, here: f32) -> vec2<f32> {
    return vec2(
        slope(depth_within(neighbor(pixel, 0)), here, depth_within(neighbor(pixel, 1))),
        slope(depth_within(neighbor(pixel, 2)), here, depth_within(neighbor(pixel, 3))),
    );
}

fn depth_within(pixel: vec2<i32>) -> f32 {
    return scene_depth_at(vec2<u32>(nearest_drawn(pixel)), 0u);
}
#endif

// Returns the depth of a pixel where a prop is solid, or 0 if that is not the one with this number.
fn solid_of(pixel: vec2<i32>, own: u32) -> f32 {
    let at = nearest_drawn(pixel);
    let solid = textureLoad(depth, at, 0);
    let is_own = owner_of(textureLoad(owner, at, 0)) == own && is_solid(solid);
    return select(0.0, solid, is_own && all(at == pixel));
}

// Returns the slope of a prop along one axis, as `slope` does. Where a neighbor sees something else, that from the other.
fn slope_of_prop(before: f32, here: f32, after: f32) -> f32 {
    let has = vec2(before, after) > vec2(0.0);
    let first = select(here, 2.0 * here - after, has.y);
    let second = select(here, 2.0 * here - before, has.x);
    return slope(select(first, before, has.x), here, select(second, after, has.y));
}

// Returns how the depth of the prop that is solid at a pixel changes from pixel to pixel.
fn prop_slope(pixel: vec2<i32>, own: u32, here: f32) -> vec2<f32> {
    return vec2(
        slope_of_prop(solid_of(neighbor(pixel, 0), own), here, solid_of(neighbor(pixel, 1), own)),
        slope_of_prop(solid_of(neighbor(pixel, 2), own), here, solid_of(neighbor(pixel, 3), own)),
    );
}

// How far in front of the solid pixels around it a ray begins, in finest cells.
const LEAD: f32 = 4.0;

// Returns where rays through a pixel begin: a little in front of the solid part of the prop there and around it.
// Whatever is in front of that is haze, which says nothing about coverage. Rays begin at the box in two cases: where all
// of the prop around is haze, and where the prop is all around, as at slits, because it may be glass, through which its
// other parts are seen.
fn start(pixel: vec2<i32>, index: u32, prop: Prop) -> f32 {
    var nearest = FAR_AWAY;
    var farthest = -FAR_AWAY;
    var is_inside = true;
    var is_opaque = false;
    for (var i = 0; i < 9; i++) {
        let at = nearest_drawn(pixel + vec2(i % 3 - 1, i / 3 - 1));
        let solid = textureLoad(depth, at, 0);
        let texel = textureLoad(owner, at, 0);
        let is_same = owner_of(texel) == index + 1u;
        is_inside = is_inside && is_same;
        is_opaque = is_opaque || (is_same && !is_in_haze(texel));
        if is_solid(solid) && is_same {
            let distance = distance_from_depth(solid);
            nearest = min(nearest, distance);
            farthest = max(farthest, distance);
        }
    }
    // Within the pixel, the surface may come nearer by as much as it does around it.
    let before = (2.0 * nearest - farthest - prop.near) * ray_at(prop, vec2<f32>(pixel) + 0.5).length;
    let scale = prop.scale;
    let cell = 1.0 / (max(max(scale.x, scale.y), scale.z) * f32(1u << field.depth));
    return select(0.0, before - LEAD * cell, nearest < FAR_AWAY && is_opaque && !is_inside);
}

// Distances in the pixels of an owner are relative to this depth, so that they are as exact as depths, no matter how
// large the prop's box is: that of what is solid at the center, or that where the owner's rays begin.
fn base_depth(solid: f32, owner: u32) -> f32 {
    return select(solid_depth_at_distance(props[max(owner, 1u) - 1u].near), solid, is_solid(solid));
}

// Half floats hold this many times the difference of two depths, relative to one of them: digits of float32 are not lost
// to small half floats, and up to 64 times the distance has a place.
const PLACES: f32 = 1024.0;

// Returns the place of a distance along the view axis.
fn place_of(distance: f32, base: f32) -> f32 {
    return PLACES * (base / solid_depth_at_distance(distance) - 1.0);
}

// Returns the distance along the view axis of a place.
fn distance_of(place: f32, base: f32) -> f32 {
    return distance_from_depth(base / (1.0 + place / PLACES));
}

// Packs a number of a ray at its place among those of eight rays.
fn packed(ray: u32, value: f32) -> vec4<u32> {
    let half = (pack2x16float(vec2(value, 0.0)) & 0xffffu) << (16u * (ray & 1u));
    return select(vec4(0u), vec4(half), vec4(ray >> 1u) == vec4(0u, 1u, 2u, 3u));
}

// Returns what `packed` packed.
fn unpacked(ray: u32, values: vec4<u32>) -> f32 {
    return unpack2x16float(values[ray >> 1u] >> (16u * (ray & 1u))).x;
}

// Rays whose colors differ by less see one color, in encoded sRGB.
const COLOR_DIFFERENCE: f32 = 0.1;

// One of the two colors of a prop within a pixel.
struct Color {
    // The rays that see it.
    bits: u32,
    // The sum of what they see, divided by the number of all rays: encoded sRGB premultiplied by opacity, and opacity.
    sum: vec4<f32>,
}

// Returns the difference of the mean color of some rays and that of another ray.
fn difference(color: Color, ray: vec4<f32>) -> f32 {
    return distance(color.sum.rgb / max(color.sum.a, 1e-6), ray.rgb / max(ray.a, 1e-6));
}

// Returns whether a ray sees the second color. The first ray sees the first one.
fn is_second(first: Color, second: Color, ray: vec4<f32>) -> bool {
    let from_first = difference(first, ray);
    let is_new = first.bits != 0u && from_first > COLOR_DIFFERENCE;
    return select(is_new, difference(second, ray) < from_first, second.bits != 0u);
}

#ifdef MULTISAMPLED
// Returns what is left of a color without some rays.
fn without(color: Color, rays: u32) -> Color {
    let bits = color.bits & ~rays;
    return Color(bits, color.sum * f32(countOneBits(bits)) / max(f32(countOneBits(color.bits)), 1.0));
}
#endif

// A pixel at an edge, and the prop through which its rays are cast.
struct Listed {
    pixel: vec2<i32>,
    // The result of the outline pass.
    owners: vec2<u32>,
    prop: u32,
    // Whether the prop owns the pixel.
    is_own: bool,
    // Whether there is such a pixel at all.
    is_here: bool,
}

// Returns the pixel that is drawn at a place of a batch.
fn listed_at(in: Varying) -> Listed {
    let place = vec2<u32>(in.position.xy);
    let batch = batch_of(place, list_of(in.prop, #{PART}u));
    let element = place_of_element(batch, index_in_batch(place % BATCH));
    if element == NO_ELEMENT {
        return Listed(vec2(0), vec2(0u), 0u, false, false);
    }
    let pixel = vec2<i32>(place / BATCH * BATCH + vec2(element % BATCH, element / BATCH));
    let owners = textureLoad(outline, pixel, 0).xy;
#ifdef OF_OWNERS
    let is_own = true;
#else
    let is_own = owners.y == 0u;
#endif
    let prop = select(owners.y, owners.x, is_own) - 1u;
    // Several fields may share a list.
    return Listed(pixel, owners, prop, is_own, props[prop].field == props[in.prop].field);
}

// What is seen at the center of a pixel, if that is another prop than the one of the rays.
struct Center {
    // Its depth, and how that changes from pixel to pixel.
    solid: f32,
    slope: vec2<f32>,
    base: f32,
    // Whether it hides what is behind it, and whether it is drawn before the prop of the rays.
    hides: bool,
    is_before: bool,
}

fn center_of(listed: Listed) -> Center {
    let own = owner_of(textureLoad(owner, listed.pixel, 0));
    let solid = textureLoad(depth, listed.pixel, 0);
    let hides = !listed.is_own && is_solid(solid);
    var slope = vec2(0.0);
    if hides {
        slope = prop_slope(listed.pixel, own, solid);
    }
    return Center(solid, slope, base_depth(solid, own), hides, own < listed.prop + 1u);
}

// The depth of the scene within a pixel.
struct Scene {
#ifdef MULTISAMPLED
    samples: array<f32, #{SAMPLES}>,
    farthest: f32,
#else
    depth: f32,
    slope: vec2<f32>,
#endif
}

fn scene_at(pixel: vec2<i32>) -> Scene {
#ifdef MULTISAMPLED
    var scene = Scene();
    scene.farthest = 1.0;
    for (var s = 0u; s < #{SAMPLES}u; s++) {
        scene.samples[s] = scene_depth_at(vec2<u32>(pixel), s);
        scene.farthest = min(scene.farthest, scene.samples[s]);
    }
    return scene;
#else
    let depth = depth_within(pixel);
    return Scene(depth, scene_slope(pixel, depth));
#endif
}

// What the rays of a pixel see.
struct Cast {
    first: Color,
    second: Color,
    // The same sum of the rays that are not covered.
    thin: vec4<f32>,
    // The rays that something else hides, and those where the prop is before what is seen at the center.
    hidden: u32,
    before: u32,
#ifdef OF_OWNERS
    places: vec4<u32>,
#endif
}

fn cast_rays(listed: Listed, center: Center, scene: Scene, prop: Prop, begins: f32, h: ptr<function, Harmonics>) -> Cast {
    var seen = Cast();
    let has_two_colors = listed.is_own && listed.owners.y == 0u;
    let share = 1.0 / f32(view.edge_rays);
#ifdef MULTISAMPLED
    var scene_samples = scene.samples;
#endif
#ifdef OF_OTHERS
    let places = textureLoad(own_places, listed.pixel, 0);
    let has_places = all(listed.owners > vec2(0u));
#endif
    for (var ray = 0u; ray < view.edge_rays; ray++) {
        var bits = 1u << ray;
        var offset = ray_offset(ray);
        if view.edge_rays < RAYS {
            // Each of four rays counts as two.
            bits = 3u << (2u * ray);
            offset = offset_of_four(ray);
        }
#ifdef MULTISAMPLED
        let limit = scene_samples[sample_of(ray, #{SAMPLES}u)];
        // To tell hidden parts from missing ones, march as far as anything is seen.
        let last = scene.farthest;
#else
        let limit = max(scene.depth + dot(scene.slope, offset), 0.0);
        let last = limit;
#endif
        let found = look(prop, vec2<f32>(listed.pixel) + 0.5 + offset, begins, last, h);
        let distance = found.distance;
        let is_covered = found.is_covered && distance < distance_from_depth(limit);
#ifdef OF_OWNERS
        seen.places |= packed(ray, select(0.0, place_of(distance, center.base), is_covered));
#endif
        var own_distance = distance_from_depth(max(center.solid + dot(center.slope, offset), 0.0));
        var knows_distance = center.hides;
#ifdef OF_OTHERS
        own_distance = select(own_distance, distance_of(unpacked(ray, places), center.base), has_places);
        knows_distance = center.hides || has_places;
#endif
        let is_before = select(center.is_before, distance < own_distance, knows_distance);
        let is_of_second = has_two_colors && is_second(seen.first, seen.second, found.color);
        let color = select(vec4(0.0), found.color * share, is_covered);
        seen.first.sum += select(color, vec4(0.0), is_of_second);
        seen.second.sum += select(vec4(0.0), color, is_of_second);
        seen.first.bits |= select(0u, bits, is_covered && !is_of_second);
        seen.second.bits |= select(0u, bits, is_covered && is_of_second);
        seen.thin += select(found.color * share, vec4(0.0), found.is_covered);
        seen.hidden |= select(0u, bits, found.is_covered && !is_covered);
        seen.before |= select(0u, bits, is_covered && is_before);
    }
    return seen;
}

#ifdef MULTISAMPLED
// Takes away the samples of the scene where something else is in front of the prop, and returns their bits.
fn keep_samples(seen: ptr<function, Cast>) -> u32 {
    var kept = 0u;
    for (var s = 0u; s < #{SAMPLES}u; s++) {
        let rays = rays_of(s, #{SAMPLES}u);
        if countOneBits((*seen).hidden & rays) > countOneBits(((*seen).first.bits | (*seen).second.bits) & rays) {
            kept |= 1u << s;
            // Some of the rays may see the prop past what hides it.
            (*seen).first = without((*seen).first, rays);
            (*seen).second = without((*seen).second, rays);
            (*seen).before &= ~rays;
        }
    }
    return kept;
}
#endif

@fragment
fn fragment(in: Varying) {
    let listed = listed_at(in);
    if !listed.is_here {
        return;
    }
    let pixel = listed.pixel;
    let center = center_of(listed);
    let scene = scene_at(pixel);
    let prop = props[listed.prop];
    let begins = start(pixel, listed.prop, prop);
    let middle = vec2<f32>(pixel) + 0.5;
    // Within a pixel, the direction hardly changes.
    var h = harmonics(ray_at(prop, middle).unit);
    var seen = cast_rays(listed, center, scene, prop, begins, &h);
    var kept = 0u;
#ifdef MULTISAMPLED
    kept = keep_samples(&seen);
#endif
    let covered = seen.first.bits | seen.second.bits;
    var bits = vec4(seen.first.bits, 0u, seen.second.bits, kept);
    var own_color = seen.first.sum;
    if !listed.is_own {
        bits = vec4(0u, seen.before, covered, select(kept, 0u, listed.owners.x > 0u));
        own_color = vec4(0.0);
    }
    if !listed.is_own && listed.owners.x == 0u {
#ifdef MULTISAMPLED
        let limit = scene.samples[0];
#else
        let limit = scene.depth;
#endif
        let at_center = look(prop, middle, begins, limit, &h);
        let others = RAYS - countOneBits(covered | seen.hidden);
        if !at_center.is_covered && others > 0u && !center.hides {
            // As the layer shows it.
            let rays = premultiplied_tinted(seen.thin * f32(RAYS) / f32(others), prop.tint);
            own_color = thinned(premultiplied_tinted(at_center.color, prop.tint), rays);
        }
    }
    let at = word_at(vec2<u32>(pixel), view.size.x);
#ifdef OF_OTHERS
    // What the owner covers is known.
    coverage[at] = word_of(bits) | select(0u, coverage[at], all(listed.owners > vec2(0u)));
#else
    coverage[at] = word_of(bits);
#endif
    if listed.is_own || listed.owners.x == 0u {
        textureStore(own_rays, pixel, to_half(own_color));
    }
#ifdef OF_OWNERS
    textureStore(own_places, pixel, seen.places);
#else
    textureStore(other_rays, pixel, to_half(select(seen.first.sum, seen.second.sum, listed.is_own)));
#endif
}
