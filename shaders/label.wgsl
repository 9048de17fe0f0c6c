// The label pass: writes labels where pixels are posterized, and the composite elsewhere. See section 4 of the method,
// steps 1 and 3 to 5.

#import bevy_plenoctree::color::tinted
#ifdef SMOOTH_EDGES
#import bevy_plenoctree::color::{decode, encode}
#import bevy_plenoctree::edge::{RAYS, neighbor}
#endif
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

// What a pixel shows: its color in encoded sRGB and its opacity, and what `LabelTextures` tells about it.
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
        return Seen(value.color, opacity, select(0u, 1u, opacity > 0.0), 0u);
    }
    let posterized = assign(value.color, value.owner - 1u);
    let is_view = value.owner == view.everything;
    return Seen(
        tinted(posterized.color, props[value.owner - 1u].tint),
        // Posterized props are opaque. A posterized view keeps the opacity of its pixels.
        select(1.0, opacity, is_view),
        2u + posterized.label,
        select(value.owner, 0u, is_view),
    );
}

#ifdef SMOOTH_EDGES
// The results of the outline pass and of the coverage pass. See `coverage.wgsl`.
@group(1) @binding(2) var outline: texture_2d<u32>;
@group(1) @binding(3) var coverage: texture_2d<f32>;
@group(1) @binding(4) var own_rays: texture_2d<f32>;
@group(1) @binding(5) var other_rays: texture_2d<f32>;

// What is behind the owners of a pixel's parts.
struct Behind {
    // In linear light, with opacity.
    shown: vec4<f32>,
    // Before it is posterized, in encoded sRGB.
    composite: vec3<f32>,
}

fn behind_at(pixel: vec2<u32>, seen: Seen) -> Behind {
    let value = unpack(textureLoad(filtered, pixel, 0));
    var behind = Behind(vec4(decode(seen.color), seen.alpha), value.color);
    let owners = textureLoad(outline, pixel, 0).xy;
    let thinned = textureLoad(own_rays, pixel, 0);
    // See `thinned` of `coverage.wgsl`.
    if value.owner == 0u && owners.x == 0u && owners.y > 0u && thinned.a > 0.0 {
        behind.composite = max(thinned.rgb + thinned.a * value.color, vec3(0.0));
        behind.shown = vec4(decode(behind.composite), 1.0 - thinned.a * (1.0 - seen.alpha));
    }
    return behind;
}

// Returns what neighbors show that none of the owners owns, or `center` if there are none.
fn around(pixel: vec2<u32>, owners: vec2<u32>, center: Behind) -> Behind {
    var sum = Behind(vec4(0.0), vec3(0.0));
    var total = 0.0;
    for (var i = 0; i < 8; i++) {
        let at = vec2<u32>(neighbor(vec2<i32>(pixel), i));
        if is_drawn(at) {
            let value = unpack(textureLoad(filtered, at, 0));
            if value.owner == 0u || all(vec2(value.owner) != owners) {
                let behind = behind_at(at, seen_at(at));
                // One that the edge of a mesh crosses counts less.
                let rays = vec4<u32>(textureLoad(coverage, at, 0) * 255.0 + 0.5);
                let share = 1.0 + f32(RAYS - countOneBits(rays.r | rays.b));
                let weight = share * share;
                sum.shown += weight * behind.shown;
                sum.composite += weight * behind.composite;
                total += weight;
            }
        }
    }
    if total == 0.0 {
        return center;
    }
    return Behind(sum.shown / total, sum.composite / total);
}

// Returns what rays show of their owner, over `behind`: the label of their mean color.
fn posterized(rays: vec4<f32>, owner: u32, behind: vec3<f32>) -> vec3<f32> {
    let over = rays.rgb + max(1.0 - rays.a, 0.0) * behind;
    return decode(tinted(assign(over, owner - 1u).color, props[owner - 1u].tint));
}

// Blends the parts of a pixel, in linear light as multisampling does. `seen` is what its center shows. Returns the
// samples of the target to write.
fn blend_parts(pixel: vec2<u32>, seen: ptr<function, Seen>) -> u32 {
    let owners = textureLoad(outline, pixel, 0).xy;
    if all(owners == vec2(0u)) {
        return 0xffffffffu;
    }
    let bits = vec4<u32>(textureLoad(coverage, pixel, 0) * 255.0 + 0.5);
    // Without an owner that has parts, the center stands for all that the other one does not cover.
    let has_own = owners.x > 0u;
    let own = countOneBits(select(0u, bits.r & ~bits.g, has_own));
    let other = countOneBits(select(bits.g, bits.g | (bits.b & ~bits.r), has_own));
    var all_rays = RAYS;
    var written = 0xffffffffu;
    var is_center = !has_own;
#ifdef SAMPLES
    // The target has the samples of the scene, and those before the owners keep their color.
    all_rays -= countOneBits(bits.a) * RAYS / #{SAMPLES}u;
    written = ~bits.a;
#else
    // The scene's color at the edge of a mesh is that of several objects.
    is_center = is_center && bits.a == 0u;
#endif
    if other == 0u && (is_center || own == all_rays) {
        return select(0xffffffffu, written, has_own && own > 0u);
    }
    let rest = all_rays - min(own + other, all_rays);

    var behind = behind_at(pixel, *seen);
    if !is_center {
        behind = around(pixel, owners, behind);
    }
    var sum = f32(rest) * behind.shown;
    if own > 0u {
        let rays = textureLoad(own_rays, pixel, 0) * f32(RAYS) / f32(countOneBits(bits.r));
        sum += f32(own) * vec4(posterized(rays, owners.x, behind.composite), 1.0);
    }
    if other > 0u {
        let rays = textureLoad(other_rays, pixel, 0) * f32(RAYS) / f32(countOneBits(bits.b));
        sum += f32(other) * vec4(posterized(rays, owners.y, behind.composite), 1.0);
    }
    sum /= f32(max(own + other + rest, 1u));
    (*seen).color = encode(sum.rgb);
    (*seen).alpha = sum.a;
    return written;
}
#endif

#ifdef LABEL_TEXTURES
// The textures that custom stages read.
struct Fragment {
    // Encoded sRGB, and opacity.
    @location(0) color: vec4<f32>,
    // x: 0 where no prop is drawn, 1 where one is drawn as trained, or 2 + the index of the label. y: 1 + the index of
    // the posterized prop, or 0.
    @location(1) label: vec2<u32>,
}
#else
struct Fragment {
    @location(0) color: vec4<f32>,
#ifdef SAMPLES
    @builtin(sample_mask) samples: u32,
#endif
}
#endif

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Fragment {
#ifdef LABEL_TEXTURES
    let pixel = vec2<u32>(position.xy);
#else
    let pixel = vec2<u32>(position.xy) - view.corner;
#endif
    if !is_drawn(pixel) {
        discard;
    }
    var seen = seen_at(pixel);
#ifdef SMOOTH_EDGES
    let samples = blend_parts(pixel, &seen);
#endif
    if seen.alpha == 0.0 && seen.label == 0u {
        discard;
    }
#ifdef LABEL_TEXTURES
    return Fragment(vec4(seen.color, seen.alpha), vec2(seen.label, seen.owner));
#else
    let color = vec4(to_target(seen.color), seen.alpha);
#ifdef SAMPLES
    return Fragment(color, samples);
#else
    return Fragment(color);
#endif
#endif
}
