// The label pass: assigns labels where pixels are posterized, and shows the composite elsewhere. See section 4 of the
// method, steps 1 and 3 to 5.

#import bevy_plenoctree::color::tinted
#import bevy_plenoctree::filter_texel::unpack
#import bevy_plenoctree::labels::assign
#ifdef LIGHTING
#import bevy_plenoctree::shade::{Shade, lit_prop, shade_of}
#endif
#import bevy_plenoctree::view::{props, view}

@group(1) @binding(0) var filtered: texture_2d<u32>;
@group(1) @binding(1) var layer: texture_2d<f32>;

// What a pixel shows: its color in encoded sRGB and its opacity, and what `LabelTextures` says about it.
struct Seen {
    color: vec3<f32>,
    alpha: f32,
    label: u32,
    owner: u32,
}

fn seen_at(pixel: vec2<u32>) -> Seen {
    let opacity = textureLoad(layer, pixel, 0).a;
    let value = unpack(textureLoad(filtered, pixel, 0));
    if value.owner == 0u {
        var color = value.color;
#ifdef LIGHTING
        let trained = lit_prop(pixel);
        if trained > 0u && opacity > 0.0 {
            // What shows through the prop keeps its light.
            let own = textureLoad(layer, pixel, 0).rgb;
            let shade = shade_of(pixel, trained - 1u, false);
            color += opacity * tinted(own / opacity, shade.tint * (1.0 - shade.missing)) - own;
        }
#endif
        return Seen(color, opacity, select(0u, 1u, opacity > 0.0), 0u);
    }
    let is_view = value.owner == view.everything;
    var tint = props[value.owner - 1u].tint;
    var missing = 0.0;
#ifdef LIGHTING
    // In a posterized view, lights fall on props as trained.
    let lit = select(value.owner, lit_prop(pixel), is_view);
    if lit > 0u {
        let shade = shade_of(pixel, lit - 1u, true);
        tint *= shade.tint;
        missing = shade.missing;
    }
#endif
    let posterized = assign(value.color, value.owner - 1u, missing);
    return Seen(
        tinted(posterized.color, tint),
        // Posterized props are opaque. A posterized view keeps the opacity of its pixels.
        select(1.0, opacity, is_view),
        2u + posterized.label,
        select(value.owner, 0u, is_view),
    );
}

struct Fragment {
    // Encoded sRGB, and opacity. The opacity is negative where nothing is drawn.
    @location(0) color: vec4<f32>,
#ifdef LABEL_TEXTURES
    // x: 0 where no prop is drawn, 1 where one is drawn as trained, or 2 + the index of the label. y: 1 + the index of
    // the posterized prop, or 0.
    @location(1) label: vec2<u32>,
#endif
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
    let seen = seen_at(vec2<u32>(position.xy));
    return Fragment(
        select(vec4(seen.color, seen.alpha), vec4(0.0, 0.0, 0.0, -1.0), seen.label == 0u),
#ifdef LABEL_TEXTURES
        vec2(seen.label, seen.owner),
#endif
    );
}
