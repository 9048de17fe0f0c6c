// Recolors what is not posterized, as far as it belongs to palette colors that have changed. See section 4 of the method,
// step 9.
#define_import_path bevy_plenoctree::recolor

#import bevy_plenoctree::color::{encode, oklab, tinted, tone_space}
#import bevy_plenoctree::view::{colors, labelings, props}
#import bevy_render::color_operations::oklab_to_linear_rgb

// The square of the distance in tone space over which membership passes from one palette color to another that is as near.
// Matches `plenoctree::palette`.
const REACH: f32 = 0.08 * 0.08;

// Returns a color of a prop, in encoded sRGB. It is the same to the bit if it only belongs to palette colors that have not
// changed.
fn recolored(prop: u32, color: vec3<f32>) -> vec3<f32> {
    let count = labelings[prop].colors;
    let source = labelings[prop].first_color;
    let shown = source + count;
    let tones = shown + count;
    let place = tone_space(color);
    var least = 1e30;
    for (var i = 0u; i < count; i++) {
        let off = place - colors[tones + i].rgb;
        least = min(least, dot(off, off));
    }
    var moved = vec3(0.0);
    var total = 0.0;
    for (var i = 0u; i < count; i++) {
        let off = place - colors[tones + i].rgb;
        let near = max(1.0 - (dot(off, off) - least) / REACH, 0.0);
        let share = near * near;
        total += share;
        if share > 0.0 && any(colors[source + i].rgb != colors[shown + i].rgb) {
            moved += share * (oklab(colors[shown + i].rgb) - oklab(colors[source + i].rgb));
        }
    }
    if all(moved == vec3(0.0)) {
        return color;
    }
    return encode(max(oklab_to_linear_rgb(oklab(color) + moved / total), vec3(0.0)));
}

// The same for a color that the prop's tint has been applied to.
fn recolored_in_tint(prop: u32, color: vec3<f32>) -> vec3<f32> {
    let tint = props[prop].tint;
    let own = tinted(color, 1.0 / max(tint, vec3(1e-3)));
    let shown = recolored(prop, own);
    return select(tinted(shown, tint), color, all(shown == own));
}
