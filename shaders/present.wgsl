// The present pass: writes the output of the label pass, or of custom stages, to the view's target.

#import bevy_plenoctree::edge::{bits_of, parts_of, word_at}
#import bevy_plenoctree::target::to_target
#import bevy_plenoctree::view::{is_drawn, nearest_drawn, view}

@group(1) @binding(0) var colors: texture_2d<f32>;
#ifdef TARGET_SAMPLES
// The results of the outline pass and of the coverage pass.
@group(2) @binding(0) var outline: texture_2d<u32>;
@group(2) @binding(1) var<storage, read> coverage: array<u32>;
#endif

struct Fragment {
    @location(0) color: vec4<f32>,
#ifdef TARGET_SAMPLES
    @builtin(sample_mask) samples: u32,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let at = vec2<u32>(position.xy) - view.corner;
    let pixel = vec2<u32>(nearest_drawn(vec2<i32>(at)));
    let color = textureLoad(colors, pixel, 0);
    // Nothing is drawn where opacity is negative.
    if !is_drawn(at) || color.a < 0.0 {
        discard;
    }
    let shown = vec4(to_target(color.rgb), color.a);
#ifdef TARGET_SAMPLES
    let owners = textureLoad(outline, pixel, 0).xy;
    return Fragment(shown, parts_of(owners, bits_of(owners, coverage[word_at(pixel, view.size.x)])).written);
#else
    return Fragment(shown);
#endif
}
