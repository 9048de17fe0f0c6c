// The outline pass: finds the pixels at which posterized props end, and the props that may cover parts of them.

#import bevy_plenoctree::edge::neighbor
#import bevy_plenoctree::view::{is_solid, owner_of, props, view}
#ifdef COARSE
#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::edge::RAYS
#ifdef MULTISAMPLED
#import bevy_plenoctree::edge::rays_of
#import bevy_plenoctree::scene::scene_depth
#endif
#endif

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;

struct Fragment {
    // x: the owner of the pixel. y: the nearest other owner of a neighbor. 0 if there is none, or its edges stay hard.
    @location(0) owners: vec2<u32>,
    // As in `coverage.wgsl`. 0 if that pass writes them.
    @location(1) bits: vec4<f32>,
    @location(2) own_color: vec4<f32>,
    @location(3) other_color: vec4<f32>,
    // 1 where a prop ends, and 0 elsewhere, for the depth test of the passes that follow.
    @builtin(frag_depth) mask: f32,
}

fn smooths(owner: u32) -> bool {
    return owner > 0u && props[max(owner, 1u) - 1u].smooths_edges > 0u;
}

fn is_inside(pixel: vec2<i32>) -> bool {
    return all(pixel >= vec2(0)) && all(pixel < vec2<i32>(view.size));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<i32>(position.xy);
    let own = owner_of(textureLoad(owner, pixel, 0));
    var ends = false;
    var other = 0u;
    var nearest = 0.0;
    var toward = pixel;
    for (var i = 0; i < 8; i++) {
        let at = neighbor(pixel, i);
        if is_inside(at) {
            let there = owner_of(textureLoad(owner, at, 0));
            ends = ends || there != own;
            if there != own && smooths(there) {
                let solid = textureLoad(depth, at, 0);
                // Where neither is solid, the one that is drawn later is before the other one.
                if solid > nearest || (solid == nearest && there > other) {
                    other = there;
                    nearest = solid;
                    toward = at;
                }
            }
        }
    }
    if own == 0u && other > 0u && textureLoad(layer, pixel, 0).a >= props[other - 1u].min_opacity {
        // A prop as trained covers the pixel. If it is solid there, the coverage pass knows what is before it.
#ifdef COARSE
        other = 0u;
#else
        other = select(0u, other, is_solid(textureLoad(depth, pixel, 0)));
#endif
    }
    let kept = select(0u, own, smooths(own));
#ifdef COARSE
    // The rays of a coarse layer do not show which of two props is before the other one within a pixel.
    other = select(other, 0u, own > 0u);
#endif
    if !ends || (kept == 0u && other == 0u) {
        // The pixel may hold what was drawn before.
        return Fragment();
    }
#ifdef COARSE
    let prop = select(other, kept, kept > 0u) - 1u;
    let solid = select(nearest, textureLoad(depth, pixel, 0), kept > 0u);
    let seen = ramp(pixel, prop, solid);
    let bits = select(vec4(0u, seen.x, seen.x, seen.y), vec4(seen.x, 0u, 0u, seen.y), kept > 0u);
    let share = f32(countOneBits(seen.x)) / f32(RAYS);
    // A neighbor shows the color of the other owner.
    let color = to_half(share * textureLoad(layer, select(toward, pixel, kept > 0u), 0));
    return Fragment(
        vec2(kept, other),
        vec4<f32>(bits) / 255.0,
        select(vec4(0.0), color, kept > 0u),
        select(color, vec4(0.0), kept > 0u),
        1.0,
    );
#else
    return Fragment(vec2(kept, other), vec4(0.0), vec4(0.0), vec4(0.0), 1.0);
#endif
}

#ifdef COARSE
fn opacity(pixel: vec2<i32>) -> f32 {
    return textureLoad(layer, clamp(pixel, vec2(0), vec2<i32>(view.size) - 1), 0).a;
}

// Returns the rays that a prop covers if its opacity is a plane around the pixel, and the samples that are before it.
fn ramp(pixel: vec2<i32>, prop: u32, solid: f32) -> vec2<u32> {
    let slope = 0.5 * vec2(
        opacity(neighbor(pixel, 1)) - opacity(neighbor(pixel, 0)),
        opacity(neighbor(pixel, 3)) - opacity(neighbor(pixel, 2)),
    );
    let distance = (opacity(pixel) - props[prop].min_opacity) / max(length(slope), 1e-6);
    var rays = (1u << u32(round(clamp(0.5 + distance, 0.0, 1.0) * f32(RAYS)))) - 1u;
    var before = 0u;
#ifdef MULTISAMPLED
    var others = 0u;
    for (var s = 0u; s < #{SAMPLES}u; s++) {
        let scene = textureLoad(scene_depth, vec2<u32>(pixel) + view.corner, s);
        if is_solid(solid) && scene > solid {
            before |= 1u << s;
        } else {
            others |= rays_of(s, #{SAMPLES}u);
        }
    }
    // If the edge of a mesh crosses the pixel, the prop covers the rest.
    rays = select(rays, others, before > 0u && others > 0u);
    before = select(0u, before, others > 0u);
#endif
    return vec2(rays, before);
}
#endif
