// The composite pass: blends the layer over the scene, in encoded sRGB. Posterization works on the result, and where
// labels are tones, on the layer alone. With OUTLINE, it also finds the pixels at the edges of props.

#import bevy_plenoctree::filter_texel::{pack, pack_filtered, pack_shown}
#import bevy_plenoctree::edge_owners::{edge_at, layer, owner}
#import bevy_plenoctree::target::composited
#import bevy_plenoctree::view::{filters, owner_of, screen, view}

@group(1) @binding(3) var scene: texture_2d<f32>;

struct Fragment {
    @location(0) texel: vec4<u32>,
#ifdef OUTLINE
    // See `Edge`.
    @location(1) owners: vec2<u32>,
    @builtin(frag_depth) mask: f32,
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
    var texel = pack_shown(color);
#ifdef APART
    let is_read = posterized > 0u;
#else
    let is_read = true;
#endif
    if is_read {
#ifdef UNFILTERED
        texel = pack_filtered(color, posterized);
#else
        texel = pack(color, posterized);
#endif
    }
#ifdef OUTLINE
    let edge = edge_at(vec2<i32>(pixel));
    return Fragment(texel, edge.owners, edge.mask);
#else
    return Fragment(texel);
#endif
}
