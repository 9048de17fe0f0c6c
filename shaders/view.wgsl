// What the passes of one view share: bind group 0.
#define_import_path bevy_plenoctree::view

#import bevy_plenoctree::color::to_half

struct Prop {
    // Corners of the unit cube to the corners of the box around the leaves, in clip space.
    clip_from_box: mat4x4<f32>,
    // The ray through the point p of the viewport, in pixels, in the field's frame: origin[0] + p.x origin[1] + p.y origin[2],
    // in tree units, and likewise its direction, in world units of the field, not normalised.
    origin: mat3x3<f32>,
    direction: mat3x3<f32>,
    // Tree units a world unit of the field.
    scale: vec3<f32>,
    // 1 if the transform mirrors, else 0.
    mirrored: u32,
    // The box around the leaves, in tree units.
    low: vec3<f32>,
    // Palette colours; 0 if the prop is not posterised.
    colors: u32,
    high: vec3<f32>,
    // Where the palette's extracted colours begin in `colors`; the shown ones follow.
    first_color: u32,
    blend_steps: u32,
    softness: f32,
    min_opacity: f32,
    iterations: u32,
    radius: i32,
    // 1 / (2 sigma^2) of the bilateral filter's two Gaussians.
    spatial_falloff: f32,
    range_falloff: f32,
}

struct View {
    // Upper left corner of the viewport in the target, and its size, in pixels.
    corner: vec2<u32>,
    size: vec2<u32>,
    // The z and w rows of clip_from_view's z and w columns: P22, P32, P23, P33.
    depth: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> props: array<Prop>;
@group(0) @binding(2) var<storage, read> colors: array<vec4<f32>>;

// Distance along the view axis for a value of the depth buffer (reverse z).
fn view_distance(ndc: f32) -> f32 {
    let slope = view.depth.x - ndc * view.depth.z;
    let offset = view.depth.y - ndc * view.depth.w;
    // An infinite far plane has slope 0 where nothing was drawn.
    return select(FAR_AWAY, offset / slope, abs(slope) > 1e-30 * abs(offset));
}

// Value of the depth buffer for a distance along the view axis.
fn depth_value(distance: f32) -> f32 {
    return (view.depth.y - distance * view.depth.x) / (view.depth.w - distance * view.depth.z);
}

const FAR_AWAY: f32 = 1e30;
const NOWHERE: f32 = 1000.0;

// A distance along the view axis in half floats: its logarithm in two parts, to 5e-6 of the distance.
fn pack_distance(distance: f32) -> vec2<f32> {
    if distance >= FAR_AWAY {
        return vec2(NOWHERE, 0.0);
    }
    let exponent = log2(max(distance, 1e-30));
    let high = to_half(vec4(exponent)).x;
    return vec2(high, to_half(vec4(exponent - high)).x);
}

fn unpack_distance(parts: vec2<f32>) -> f32 {
    return select(exp2(parts.x + parts.y), FAR_AWAY, parts.x >= NOWHERE);
}
