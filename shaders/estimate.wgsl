// The coverage pass where opacity shows which part of a pixel a prop covers, without rays. Finds the same as `coverage.wgsl`,
// but no color of the prop: it is that of the pixel, or of the neighbor that sees most of the prop.

#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::edge::{RAYS, ray_offset, sample_of, thinned}
#import bevy_plenoctree::edge_opacity::{opacity_around, opacity_at}
#ifdef MULTISAMPLED
#import bevy_plenoctree::scene::scene_depth_at
#import bevy_plenoctree::view::{is_solid, owner_of}
#endif

// As in `coverage.wgsl`.
@group(1) @binding(0) var outline: texture_2d<u32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var depth: texture_depth_2d;
@group(1) @binding(3) var layer: texture_2d<f32>;

struct Fragment {
    @location(0) bits: vec4<f32>,
    @location(1) own: vec4<f32>,
    @location(2) other: vec4<f32>,
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<i32>(position.xy);
    let owners = textureLoad(outline, pixel, 0).xy;
    let around = opacity_around(layer, owner, pixel, owners);
#ifdef MULTISAMPLED
    // The nearest depth of the prop.
    var solid = 0.0;
    for (var i = 0; i < 9; i++) {
        let at = pixel + vec2(i % 3 - 1, i / 3 - 1);
        let is_own = owner_of(textureLoad(owner, at, 0)) == max(owners.x, owners.y);
        solid = select(solid, max(solid, textureLoad(depth, at, 0)), is_own);
    }
#endif
    var covered = 0u;
    var kept = 0u;
    // The opacities of the rays that are not covered, and their number.
    var thin = vec2(0.0);
    for (var ray = 0u; ray < RAYS; ray++) {
        let opacity = opacity_at(around, ray_offset(ray));
        let is_covered = opacity >= around.limit;
        var is_hidden = false;
#ifdef MULTISAMPLED
        let sample = sample_of(ray, #{SAMPLES}u);
        is_hidden = is_covered && is_solid(solid) && scene_depth_at(vec2<u32>(pixel), sample) > solid;
        kept |= select(0u, 1u << sample, is_hidden);
#endif
        covered |= select(0u, 1u << ray, is_covered && !is_hidden);
        thin += select(vec2(opacity, 1.0), vec2(0.0), is_covered);
    }
    if owners.x > 0u {
        return Fragment(vec4(f32(covered), 0.0, 0.0, f32(kept)) / 255.0, vec4(0.0), vec4(0.0));
    }
    let center = textureLoad(layer, pixel, 0);
    let haze = center / max(center.a, 1e-6) * thin.x / max(thin.y, 1.0);
    let bits = vec4(0.0, f32(covered), f32(covered), f32(kept)) / 255.0;
    return Fragment(bits, to_half(thinned(center, haze)), vec4(0.0));
}
