// What the passes of one view share: bind group 0.
#define_import_path bevy_plenoctree::view

struct Prop {
    // Corners of the unit cube to the corners of the box around the leaves, in clip space.
    clip_from_box: mat4x4<f32>,
    // The ray through the point `reference` + p of the viewport, in pixels, in the field's frame: origin[0] + p.x origin[1]
    // + p.y origin[2], in tree units, and likewise its direction, in world units of the field, not normalized. It begins
    // where the box does, `near` along the view axis, so that numbers are small however far away the camera is.
    origin: mat3x3<f32>,
    direction: mat3x3<f32>,
    // Tree units a world unit of the field.
    scale: vec3<f32>,
    // 1 if the transform mirrors, else 0.
    mirrored: u32,
    // The box around the leaves, in tree units.
    low: vec3<f32>,
    // Palette colors; 0 if the prop is not posterized.
    colors: u32,
    high: vec3<f32>,
    // Where the palette's extracted colors begin in `colors`; the shown ones follow.
    first_color: u32,
    blend_steps: u32,
    softness: f32,
    min_opacity: f32,
    iterations: u32,
    radius: i32,
    // 1 / (2 sigma^2) of the bilateral filter's two Gaussians.
    spatial_falloff: f32,
    range_falloff: f32,
    reference: vec2<f32>,
    near: f32,
    // Where transmittance falls to this, the prop is solid and has a depth.
    solid_transmittance: f32,
}

struct View {
    // Upper left corner of the viewport in the target, and its size, in pixels.
    corner: vec2<u32>,
    size: vec2<u32>,
    // The z and w rows of clip_from_view's z and w columns: P22, P32, P23, P33.
    depth: vec4<f32>,
    // What the camera makes of the props' light: 1 at Bevy's default exposure, and after tonemapping.
    exposure: f32,
    // 1 + place in `props` of what posterizes the pixels that no posterized prop owns, or 0.
    everything: u32,
    // Pixels of the viewport a pixel of the volume pass.
    pixel: vec2<f32>,
    // Of the camera's quality.
    stop_transmittance: f32,
    min_weight: f32,
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

// What the volume pass says of a pixel, in two half floats, which hold integers up to 2048: which prop posterizes it (1 +
// place in `props`, or 0) and whether a prop is solid there.
fn pack_owner(owner: u32, is_solid: bool) -> vec2<f32> {
    return vec2(f32(owner & 2047u), f32(2u * (owner >> 11u) + select(0u, 1u, is_solid)));
}

fn owner_of(texel: vec4<f32>) -> u32 {
    return u32(texel.r) + ((u32(texel.g) >> 1u) << 11u);
}

fn solid_at(texel: vec4<f32>) -> bool {
    return (u32(texel.g) & 1u) == 1u;
}

// The least depth of a pixel in which there is something of a prop: 0 stands for none.
const LEAST_DEPTH: f32 = 1e-30;
