// The last pass: labels for the pixels that are posterised, the composite for the others. Section 4, steps 1 and 3 to 5.

#import bevy_plenoctree::target::to_target
#import bevy_plenoctree::view::{colors, props, view}

@group(1) @binding(0) var filtered: texture_2d<f32>;
@group(1) @binding(1) var layer: texture_2d<f32>;

// The two labels that are nearest in encoded RGB so far.
struct Nearest {
    first: f32,
    second: f32,
    first_shown: vec3<f32>,
    second_shown: vec3<f32>,
}

fn consider(nearest: ptr<function, Nearest>, color: vec3<f32>, label: vec3<f32>, shown: vec3<f32>) {
    let distance = distance(color, label);
    if distance < (*nearest).first {
        (*nearest).second = (*nearest).first;
        (*nearest).second_shown = (*nearest).first_shown;
        (*nearest).first = distance;
        (*nearest).first_shown = shown;
    } else if distance < (*nearest).second {
        (*nearest).second = distance;
        (*nearest).second_shown = shown;
    }
}

const FAR: f32 = 1e30;

fn assign(color: vec3<f32>, prop: u32) -> vec3<f32> {
    let count = props[prop].colors;
    let extracted = props[prop].first_color;
    let edited = extracted + count;
    let steps = props[prop].blend_steps;
    var nearest = Nearest(FAR, FAR, vec3(0.0), vec3(0.0));
    // Labels in the order of equation 7: the palette, then the blends of every pair.
    for (var i = 0u; i < count; i++) {
        consider(&nearest, color, colors[extracted + i].rgb, colors[edited + i].rgb);
    }
    for (var i = 0u; i < count; i++) {
        for (var j = i + 1u; j < count; j++) {
            for (var k = 1u; k < steps; k++) {
                let share = f32(k) / f32(steps);
                let label = mix(colors[extracted + j].rgb, colors[extracted + i].rgb, share);
                let shown = mix(colors[edited + j].rgb, colors[edited + i].rgb, share);
                consider(&nearest, color, label, shown);
            }
        }
    }
    let softness = props[prop].softness;
    let lead = nearest.second - nearest.first;
    // Softness 0 is a hard edge, and a palette of one colour has no second label.
    if lead >= softness || nearest.second == FAR {
        return nearest.first_shown;
    }
    let step = 0.5 + 0.5 * lead / softness;
    return mix(nearest.second_shown, nearest.first_shown, step * step * (3.0 - 2.0 * step));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy) - view.corner;
    let opacity = textureLoad(layer, pixel, 0).a;
    let value = textureLoad(filtered, pixel, 0);
    if opacity == 0.0 && value.a == 0.0 {
        discard;
    }
    var color = value.rgb;
    var alpha = opacity;
    if value.a > 0.0 {
        color = assign(color, u32(value.a) - 1u);
        // A posterised prop is opaque; the rest is as opaque as it was.
        alpha = select(1.0, opacity, u32(value.a) == view.everything);
    }
    return vec4(to_target(color), alpha);
}
