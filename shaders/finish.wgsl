// The finish pass: smooths the borders between labels, and draws ink. At the edges of props, `blend.wgsl` draws over it.

#import bevy_plenoctree::borders::{bordered, is_at_border}
#import bevy_plenoctree::color::{decode, encode, tinted}
#ifdef INK
#import bevy_plenoctree::ink::{ink_at, inked, surface_at}
#endif
#import bevy_plenoctree::shade::shade_of_owner
#import bevy_plenoctree::target::over_scene
#import bevy_plenoctree::view::{labelings, props, screen, view}

// The results of the label pass.
@group(1) @binding(0) var shown: texture_2d<f32>;
@group(1) @binding(4) var labels: texture_2d<u32>;
@group(1) @binding(1) var filtered: texture_2d<u32>;
#ifdef INK
@group(1) @binding(2) var depth: texture_depth_2d;
#endif
// The target, before the result is written to it.
@group(1) @binding(3) var scene: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let seen = textureLoad(shown, pixel, 0);
    let own = textureLoad(labels, pixel, 0).xy;
    if own.x < 2u {
        return seen;
    }
    let owner = select(own.y, screen.view_posterize, own.y == 0u);
    let prop = owner - 1u;
    var color = seen.rgb;
    let is_rough = labelings[prop].smooth_borders == 1u && is_at_border(labels, vec2<i32>(pixel), own);
    // Few pixels are. A loop that runs once or never costs nothing where it runs for none of a group of pixels, and some
    // rasterizers compute both sides of branches.
    for (var rough = select(0u, 1u, is_rough); rough > 0u; rough--) {
        let shade = shade_of_owner(pixel, owner);
        let border = bordered(labels, filtered, vec2<i32>(pixel), own, prop, shade.light);
        color = tinted(border, props[prop].tint * shade.tint);
        // The label pass has done so with its color.
        let opacity = select(seen.a, 1.0, own.y == 0u);
        color = over_scene(color, opacity, scene, pixel + view.corner);
    }
#ifdef INK
    let center = surface_at(labels, depth, vec2<i32>(pixel));
    let part = ink_at(labels, depth, vec2<i32>(pixel), center, seen.a >= 1.0);
    if part > 0.0 {
        color = encode(inked(prop, props[prop].tint, decode(color), part));
    }
#endif
    return vec4(color, seen.a);
}
