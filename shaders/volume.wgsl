// The volume pass: marches a ray for each pixel of the box around a prop's leaves. See section 2 of the method.

#import bevy_plenoctree::color::{tinted, to_half}
#import bevy_plenoctree::octree::{absorbed, begin, density, has_ended, next_leaf}
#import bevy_plenoctree::prop_ray::{PropRay, Varying, position_at, position_of, prop_ray, solid_depth_at}
#import bevy_plenoctree::radiance::{harmonics, radiance}
#import bevy_plenoctree::recolor::recolored
#import bevy_plenoctree::view::{
    AS_TRAINED, IN_HAZE, OPAQUE, is_solid_prop, labelings, motion_of, pack_owner, pack_haze, props, shows_through, view,
}

#ifdef OVERLAPPING
// The results of the solid pass's two rounds.
@group(2) @binding(0) var nearest: texture_2d<u32>;
@group(2) @binding(1) var nearest_depth: texture_depth_2d;
@group(2) @binding(2) var opaque: texture_2d<u32>;
@group(2) @binding(3) var opaque_depth: texture_depth_2d;

// The parts of props that overlap, in drawing order: what is behind the solid depth, the prop that is solid there, and
// what is in front of it. They match `Piece` in `passes/volume.rs`.
const BEHIND: u32 = 0u;
const SOLID: u32 = 1u;
const BEFORE: u32 = 2u;

// Returns the part of a ray's span that is drawn in this pixel. It may be empty.
fn part(seen: PropRay, in: Varying) -> vec2<f32> {
    let pixel = vec2<u32>(in.position.xy);
    // An opaque prop cuts all others. Without one, the nearest solid depth decides what is in front and behind.
    var texel = textureLoad(opaque, pixel, 0).x;
    var depth = textureLoad(opaque_depth, pixel, 0);
    if texel == 0u {
        texel = textureLoad(nearest, pixel, 0).x;
        depth = textureLoad(nearest_depth, pixel, 0);
    }
    let nothing = vec2(seen.span.x);
    if is_solid_prop(texel, in.prop) {
        return select(nothing, seen.span, in.part == SOLID);
    }
    let solid = position_at(seen, in.prop, depth);
    let behind = vec2(max(seen.span.x, solid), seen.span.y);
    let before = vec2(seen.span.x, min(seen.span.y, solid));
    if in.part == BEHIND {
        return select(nothing, behind, shows_through(texel));
    }
    return select(nothing, select(before, seen.span, texel == 0u), in.part == BEFORE);
}
#endif

struct Fragment {
    // Encoded sRGB premultiplied by opacity, and opacity.
    @location(0) color: vec4<f32>,
#ifdef OWNERS
    // The result of `pack_owner`. Blending writes it only where alpha is 1.
    @location(1) owner: vec4<f32>,
#endif
    // The depth of the nearest solid part of any prop: all props write the same depth, in any order. Where none is solid,
    // the result of `pack_haze`.
    @builtin(frag_depth) depth: f32,
#ifdef MOTION
    // How the solid part has moved. Blending writes it only where alpha is 1. Where it is written follows from OWNERS.
    @location(#{MOTION}) motion: vec4<f32>,
#endif
}

// What a ray sees of a prop.
struct Marched {
    // Premultiplied by opacity.
    color: vec3<f32>,
    opacity: f32,
    transmittance: f32,
    // Where the prop is solid along the ray. Negative if it is not.
    solid: f32,
    // Where the color comes from, on average, times opacity.
    middle: f32,
}

fn march(seen: PropRay, span: vec2<f32>, prop: u32) -> Marched {
    var h = harmonics(seen.unit);
    var marched = Marched(vec3(0.0), 0.0, 1.0, -1.0, 0.0);
    let stop = view.stop_transmittance;
#ifndef OVERLAPPING
    let limit = props[prop].solid_transmittance;
#endif
    var walk = begin(seen.ray, span.x);
    loop {
        if marched.transmittance < stop || has_ended(seen.ray, walk, span.y) {
            break;
        }
        let crossing = next_leaf(seen.ray, &walk, span.y);
        let sigma = density(crossing.leaf);
        let depth = sigma * (crossing.exit - crossing.enter);
        let before = marched.transmittance;
        let weight = before * absorbed(depth);
        marched.color += weight * radiance(crossing.leaf, &h);
        marched.opacity += weight;
#ifdef FOG
        marched.middle += weight * crossing.enter;
#endif
        marched.transmittance *= exp(-depth);
#ifndef OVERLAPPING
        let inside = position_of(limit, before, crossing, sigma);
        marched.solid = select(marched.solid, inside, marched.solid < 0.0 && marched.transmittance <= limit);
#endif
    }
    return marched;
}

@fragment
fn fragment(in: Varying) -> Fragment {
    let seen = prop_ray(in);
#ifdef OVERLAPPING
    let span = part(seen, in);
#else
    let span = seen.span;
#endif
    if span.x >= span.y {
        discard;
    }
    let marched = march(seen, span, in.prop);
    var color = marched.color;
    var opacity = marched.opacity;
    let solid = marched.solid;
    if opacity == 0.0 {
        discard;
    }
#ifdef FOG
    let haze = pack_haze(in.prop, solid_depth_at(seen, in.prop, marched.middle / opacity), view.props);
#else
    let haze = pack_haze(in.prop, 0.0, view.props);
#endif
    // Leaves that were not reached take the average color of the others.
    if marched.transmittance < view.stop_transmittance {
        color /= opacity;
        opacity = 1.0;
    }
    let covers = opacity >= props[in.prop].min_opacity;
    let posterized = select(0u, in.prop + 1u, covers && props[in.prop].posterized > 0u);
    if posterized == 0u {
        // Where the prop is posterized, its label is tinted instead, so that a tint does not change the label.
        var own = color / opacity;
#ifdef RECOLORED
        if labelings[in.prop].recolors == 1u {
            own = recolored(in.prop, own);
        }
#endif
        color = opacity * tinted(own, props[in.prop].tint);
    }
#ifdef OVERLAPPING
    let pixel = vec2<u32>(in.position.xy);
    let depth = textureLoad(nearest_depth, pixel, 0);
    let is_nearest = is_solid_prop(textureLoad(nearest, pixel, 0).x, in.prop);
#else
    let is_nearest = solid >= 0.0;
    let depth = select(0.0, solid_depth_at(seen, in.prop, solid), solid >= 0.0);
#endif
#ifdef LIT
    // Lights also fall on what is drawn as trained.
    let owner = select(posterized, (in.prop + 1u) | AS_TRAINED, covers && posterized == 0u);
#else
    let owner = posterized;
#endif
    let haze_mark = select(0u, IN_HAZE, posterized > 0u && opacity < OPAQUE);
    return Fragment(
        to_half(vec4(color, opacity)),
#ifdef OWNERS
        vec4(pack_owner(owner | haze_mark), 0.0, select(0.0, 1.0, covers)),
#endif
        select(haze, depth, depth > 0.0),
#ifdef MOTION
        vec4(motion_of(in.prop, seen.at, depth), 0.0, select(0.0, 1.0, is_nearest)),
#endif
    );
}
