// The pixels that show props at the display. Transparent objects are drawn there once the props are, and elsewhere
// before.
#define_import_path bevy_plenoctree::prop_pixels

#import bevy_plenoctree::view::is_drawn

@group(1) @binding(0) var layer: texture_2d<f32>;
#ifdef SMOOTH
// The result of the outline pass.
@group(1) @binding(1) var outline: texture_2d<u32>;
#endif

// Thinner haze barely shows. If tonemapping changes objects elsewhere, its border would.
const LEAST_OPACITY: f32 = 1.0 / 128.0;

fn is_at_edge(pixel: vec2<u32>) -> bool {
#ifdef SMOOTH
    return any(textureLoad(outline, pixel, 0).xy > vec2(0u));
#else
    return false;
#endif
}

fn shows_props(pixel: vec2<u32>) -> bool {
    return is_drawn(pixel) && (textureLoad(layer, pixel, 0).a > LEAST_OPACITY || is_at_edge(pixel));
}
