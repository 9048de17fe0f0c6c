// Labels: which one a color gets, and how it is shown. See section 4 of the method, steps 3 to 5.
#define_import_path bevy_plenoctree::labels

#import bevy_plenoctree::view::{colors, props}

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
