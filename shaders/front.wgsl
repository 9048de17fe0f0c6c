// What a pixel shows of props alone, at the display, for the passes that blend transparent objects over it.
#define_import_path bevy_plenoctree::front

#import bevy_plenoctree::view::owner_of

// The result of the label pass, or of custom stages.
@group(1) @binding(0) var shown: texture_2d<f32>;
@group(1) @binding(1) var layer: texture_2d<f32>;
#ifdef OWNERS
@group(1) @binding(2) var owner: texture_2d<f32>;
#endif
#ifdef SMOOTH
// The results of the outline pass and of the blend pass.
@group(1) @binding(3) var outline: texture_2d<u32>;
@group(1) @binding(4) var front: texture_2d<f32>;
#endif

struct Front {
    // What the pixel shows, and what it shows of props alone, in encoded sRGB.
    shown: vec3<f32>,
    own: vec3<f32>,
    // How much of what the pixel shows are props. 0 where there are none.
    share: f32,
    // Whether these shares are of linear light, as at smooth edges, or of encoded sRGB, as in thin parts.
    is_linear: bool,
}

fn front_at(pixel: vec2<u32>) -> Front {
    let seen = textureLoad(shown, pixel, 0);
    let share = clamp(seen.a, 0.0, 1.0);
#ifdef STAGED
    return Front(seen.rgb, seen.rgb, share, true);
#else
    var owned = 0u;
#ifdef OWNERS
    owned = owner_of(textureLoad(owner, pixel, 0));
#endif
    // What is behind shows through a prop as trained.
    let over = textureLoad(layer, pixel, 0);
    var own = select(seen.rgb, over.rgb / max(over.a, 1e-6), owned == 0u && over.a > 0.0);
    var is_mixed = false;
#ifdef SMOOTH
    let mixed = textureLoad(front, pixel, 0);
    is_mixed = any(textureLoad(outline, pixel, 0).xy > vec2(0u)) && mixed.a > 0.0;
    own = select(own, mixed.rgb, is_mixed);
#endif
    return Front(seen.rgb, own, share, is_mixed);
#endif
}
