// The composite pass: blends the layer over the scene, in encoded sRGB. Posterization works on the result, and where
// labels are tones, on the layer alone.

#ifdef UNFILTERED
#import bevy_plenoctree::filter_texel::pack_filtered
#else
#import bevy_plenoctree::filter_texel::pack
#endif
#import bevy_plenoctree::target::composited
#import bevy_plenoctree::view::{filters, owner_of, screen, view}

@group(1) @binding(0) var layer: texture_2d<f32>;
@group(1) @binding(1) var owner: texture_2d<f32>;
@group(1) @binding(2) var scene: texture_2d<f32>;

struct Fragment {
    @location(0) even: vec4<u32>,
#ifndef UNFILTERED
    // The filter does not write pixels without an owner, but reads them from both of its textures.
    @location(1) odd: vec4<u32>,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let pixel = vec2<u32>(position.xy);
    let over = textureLoad(layer, pixel, 0);
    let prop = owner_of(textureLoad(owner, pixel, 0));
    let posterized = select(prop, screen.view_posterize, prop == 0u);
    // What is behind a prop would give its edges and haze labels that are not its own.
    let is_own = prop > 0u && filters[max(prop, 1u) - 1u].is_of_tones == 1u;
    var color = over.rgb / max(over.a, 1e-6);
    if !is_own {
        color = composited(over, textureLoad(scene, pixel + view.corner, 0).rgb);
    }
#ifdef UNFILTERED
    return Fragment(pack_filtered(color, posterized));
#else
    let texel = pack(color, posterized);
    return Fragment(texel, texel);
#endif
}
