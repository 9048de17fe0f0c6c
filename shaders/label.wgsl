// The label pass: writes labels where pixels are posterized, and the composite elsewhere. See section 4 of the method,
// steps 1 and 3 to 5.

#import bevy_plenoctree::color::tinted
#import bevy_plenoctree::filter_texel::unpack
#ifndef LABEL_TEXTURES
#import bevy_plenoctree::target::to_target
#endif
#import bevy_plenoctree::view::{colors, is_drawn, props, view}

@group(1) @binding(0) var filtered: texture_2d<u32>;
@group(1) @binding(1) var layer: texture_2d<f32>;

// A label: a blend of the palette colors `first` and `second`, where `share` is the weight of `first`.
struct Label {
    first: u32,
    second: u32,
    share: f32,
    // The squared distance to the pixel's color, in encoded RGB.
    distance: f32,
    // Its index among all labels.
    index: u32,
}

// The two nearest labels so far.
struct Nearest {
    first: Label,
    second: Label,
}

fn consider(nearest: ptr<function, Nearest>, label: Label) {
    if label.distance < (*nearest).first.distance {
        (*nearest).second = (*nearest).first;
        (*nearest).first = label;
    } else if label.distance < (*nearest).second.distance {
        (*nearest).second = label;
    }
}

// Returns the color of a label in the palette that begins at `palette`.
fn shown(palette: u32, label: Label) -> vec3<f32> {
    return mix(colors[palette + label.second].rgb, colors[palette + label.first].rgb, label.share);
}

const FAR: f32 = 1e30;

// The color of a pixel, and the index of its nearest label.
struct Shown {
    color: vec3<f32>,
    label: u32,
}

fn assign(color: vec3<f32>, prop: u32) -> Shown {
    let count = props[prop].colors;
    let source = props[prop].first_color;
    let edited = source + count;
    let steps = props[prop].blend_steps;
    let none = Label(0u, 0u, 1.0, FAR, 0u);
    var nearest = Nearest(none, none);
    // Labels in the order of equation 7: the palette, then the blends of every pair.
    for (var i = 0u; i < count; i++) {
        let off = color - colors[source + i].rgb;
        consider(&nearest, Label(i, i, 1.0, dot(off, off), i));
    }
    var index = count;
    for (var i = 0u; i < count; i++) {
        let first = colors[source + i].rgb;
        for (var j = i + 1u; j < count; j++) {
            let second = colors[source + j].rgb;
            for (var k = 1u; k < steps; k++) {
                let share = f32(k) / f32(steps);
                let off = color - mix(second, first, share);
                consider(&nearest, Label(i, j, share, dot(off, off), index));
                index++;
            }
        }
    }
    let softness = props[prop].softness;
    let lead = sqrt(nearest.second.distance) - sqrt(nearest.first.distance);
    let first = shown(edited, nearest.first);
    // Softness 0 gives a hard edge. A palette of one color has no second label: its distance remains FAR.
    if lead >= softness {
        return Shown(first, nearest.first.index);
    }
    let step = 0.5 + 0.5 * lead / softness;
    let soft = mix(shown(edited, nearest.second), first, step * step * (3.0 - 2.0 * step));
    return Shown(soft, nearest.first.index);
}

#ifdef LABEL_TEXTURES
// The textures that custom stages read.
struct Fragment {
    // Encoded sRGB, and opacity.
    @location(0) color: vec4<f32>,
    // x: 1 where a prop is drawn as trained, or 2 + the index of the label. y: 1 + the index of the posterized prop, or
    // 0.
    @location(1) label: vec2<u32>,
}
#else
struct Fragment {
    @location(0) color: vec4<f32>,
}
#endif

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
#ifdef LABEL_TEXTURES
    let pixel = vec2<u32>(position.xy);
#else
    let pixel = vec2<u32>(position.xy) - view.corner;
#endif
    let opacity = textureLoad(layer, pixel, 0).a;
    let value = unpack(textureLoad(filtered, pixel, 0));
    if !is_drawn(pixel) || (opacity == 0.0 && value.owner == 0u) {
        discard;
    }
    var color = value.color;
    var alpha = opacity;
    var label = 1u;
    if value.owner > 0u {
        let posterized = assign(color, value.owner - 1u);
        color = tinted(posterized.color, props[value.owner - 1u].tint);
        label = 2u + posterized.label;
        // Posterized props are opaque. A posterized view keeps the opacity of its pixels.
        alpha = select(1.0, opacity, value.owner == view.everything);
    }
#ifdef LABEL_TEXTURES
    let owner = select(value.owner, 0u, value.owner == view.everything);
    return Fragment(vec4(color, alpha), vec2(label, owner));
#else
    return Fragment(vec4(to_target(color), alpha));
#endif
}
