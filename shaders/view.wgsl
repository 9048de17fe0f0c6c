// Bind group 0, which the passes of a view share.
#define_import_path bevy_plenoctree::view

struct Prop {
    // Transforms the unit cube to the box around the leaves, in clip space. In shadow maps, see `shadow.wgsl`.
    clip_from_box: mat4x4<f32>,
    // The ray through the point `reference` + p of the view, in pixels, in the field's frame. Its origin is origin[0] +
    // p.x origin[1] + p.y origin[2], in tree units. Its direction has the same form, in world units of the field, and
    // is not normalized. Rays begin at the box, `near` along the view axis, so that numbers stay small no matter how
    // far away the camera is.
    origin: mat3x3<f32>,
    direction: mat3x3<f32>,
    // Tree units per world unit of the field.
    scale: vec3<f32>,
    // 1 if the transform mirrors, otherwise 0.
    mirrored: u32,
    // The lower corner of the box around the leaves, in tree units. `high` is the upper corner.
    low: vec3<f32>,
    // 1 if the prop is posterized, otherwise 0.
    posterized: u32,
    high: vec3<f32>,
    min_opacity: f32,
    reference: vec2<f32>,
    near: f32,
    // The prop is solid, and has a depth, where transmittance falls to this. Negative if it is never solid.
    solid_transmittance: f32,
    // The factors of linear light.
    tint: vec3<f32>,
    // SMOOTHS_NOTHING, SMOOTHS_SILHOUETTE or SMOOTHS_SLITS.
    smooths: u32,
    // Transforms a point of the prop from clip space to where it was in the previous frame, in that of the viewport.
    previous_from_clip: mat4x4<f32>,
    // The first of the batches that may have pixels of its box, and how many there are in a row.
    first_batch: vec2<u32>,
    batches_across: u32,
    // The number of its field and level, among those of props with smooth edges.
    field: u32,
}

// Which edges of a posterized prop are smooth: none, its silhouette, or the edges of slits too.
const SMOOTHS_NOTHING: u32 = 0u;
const SMOOTHS_SILHOUETTE: u32 = 1u;
const SMOOTHS_SLITS: u32 = 2u;

// The part of the viewport that is drawn. Its pixels are counted from its own upper left corner.
struct View {
    // Its upper left corner in the target, and its size, in pixels.
    corner: vec2<u32>,
    size: vec2<u32>,
    // The z and w rows of clip_from_view's z and w columns: P22, P32, P23, P33.
    depth: vec4<f32>,
    // Pixels per ray of the grid, along each axis.
    spacing: u32,
    // The difference between rays of the grid above which the pixels between them get rays of their own.
    ray_tolerance: f32,
    // From the camera's `PropQuality`.
    stop_transmittance: f32,
    // The number of rays through a pixel where a posterized prop ends: 4 or 8, and 8 with multisampling.
    edge_rays: u32,
    // Transforms from clip space to that of the viewport, without the camera's temporal jitter.
    unjittered_from_clip: mat4x4<f32>,
    // The least depth that the camera writes to its depth buffer, and how many times the depths from 0 to 1 they are.
    depth_range: vec2<f32>,
    // The number of `props`.
    props: u32,
    // The number of lists of pixels at edges, a power of two. See `list_of` of `batch.wgsl`.
    edge_lists: u32,
    // With parallel rays, the height of the viewport in world units, and otherwise 0.
    height: f32,
}

// How colors are shown.
struct Screen {
    // The camera's exposure relative to Bevy's default exposure, or 1 after tonemapping.
    exposure: f32,
    // 1 + the index in `props` of the posterized view, or 0. It owns the pixels that no posterized prop owns.
    view_posterize: u32,
}

// The bilateral filter of a prop.
struct Filter {
    iterations: u32,
    // How many pixels it reads on each side, and the distance between them, before it is rounded.
    taps: i32,
    spacing: f32,
    // 1 / (2 sigma^2) for its two Gaussians.
    spatial_falloff: f32,
    range_falloff: f32,
    // 1 if labels are tones, otherwise 0.
    is_of_tones: u32,
}

// The lines of a prop.
struct Ink {
    // INK_SILHOUETTE, INK_CREASES, and one of the borders of `ink.wgsl`, added up. 0 if there is no ink.
    lines: u32,
    // The index in `colors` of the pairs of ramps between which there are lines.
    pairs: u32,
    // In linear light, with opacity.
    color: vec4<f32>,
    // The share of the label's own light in this color.
    tone: f32,
    // In pixels at w = 1 in clip space.
    width: f32,
    // The difference of depth at a crease, in world units.
    crease: f32,
    // The most that the width may be.
    max_pixels: f32,
}

// A prop in the former frame, if it keeps labels.
struct FormerPlace {
    // Transforms a point of the prop from clip space to where it was then, in that of what was drawn then.
    from_clip: mat4x4<f32>,
    // The size of what was drawn then, in pixels.
    size: vec2<f32>,
    // The prop's owner then, or 0 if no label is kept.
    owner: u32,
}

// The labels of a prop, and its ink.
struct Labels {
    // The number of palette colors.
    colors: u32,
    // The index in `colors` of the palette's first source color. The shown colors follow the source colors, then the source
    // colors in the space of tones, and then these from dark to light. The last channel of a source color is its ramp, and
    // that of one of the last ones its index.
    first_color: u32,
    blend_steps: u32,
    softness: f32,
    // The index in `colors` of the place of the first source color. See `placed` of `labels.wgsl`.
    first_place: u32,
    // 1 if borders between labels are smooth, otherwise 0.
    smooth_borders: u32,
    // 1 if what is not posterized is recolored, otherwise 0.
    recolors: u32,
    // How much nearer another label must be than that of the former frame. See `steadied` of `label.wgsl`.
    steadiness: f32,
    ink: Ink,
    former: FormerPlace,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> props: array<Prop>;
@group(0) @binding(2) var<uniform> screen: Screen;
@group(0) @binding(3) var<storage, read> filters: array<Filter>;
@group(0) @binding(4) var<storage, read> labelings: array<Labels>;
@group(0) @binding(5) var<storage, read> colors: array<vec4<f32>>;

// The first result that must be drawn. Those after it are made from it, and those before it are still valid. See
// `src/render/frame/cache.rs`.
@group(0) @binding(6) var<uniform> first_drawn: u32;

// The depth of the scene, for the passes that read it.
#ifdef MULTISAMPLED
@group(0) @binding(7) var scene_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(7) var scene_depth: texture_depth_2d;
#endif

// The position of vertices if nothing must be drawn.
const NOWHERE: vec4<f32> = vec4(2.0, 2.0, 2.0, 1.0);

// Returns whether a pixel is in the part that is drawn. The scissor rectangle alone does not exclude others: with several
// samples, Mesa's software rasterizer draws a pixel beyond it.
fn is_drawn(pixel: vec2<u32>) -> bool {
    return all(pixel < view.size);
}

// Returns the pixel of that part that is nearest to another pixel.
fn nearest_drawn(pixel: vec2<i32>) -> vec2<i32> {
    return clamp(pixel, vec2(0), vec2<i32>(view.size) - 1);
}

// Returns the depth for a value of the depth buffer. Nothing that the camera draws is farther than 0.
fn depth_from_buffer(value: f32) -> f32 {
    return clamp((value - view.depth_range.x) / view.depth_range.y, 0.0, 1.0);
}

// Returns the value of the depth buffer for a depth.
fn buffer_from_depth(depth: f32) -> f32 {
    return view.depth_range.x + depth * view.depth_range.y;
}

// Returns the depth of the scene at a sample of a pixel of the viewport.
fn scene_depth_at(pixel: vec2<u32>, sample: u32) -> f32 {
    return depth_from_buffer(textureLoad(scene_depth, pixel + view.corner, sample));
}

#ifdef MULTISAMPLED
// Returns the share of a pixel's samples at which a mesh is before this depth.
fn share_before(pixel: vec2<u32>, depth: f32) -> f32 {
    let samples = textureNumSamples(scene_depth);
    var count = 0u;
    for (var i = 0u; i < samples; i++) {
        count += select(0u, 1u, scene_depth_at(pixel, i) > depth);
    }
    return f32(count) / f32(samples);
}
#endif

// Returns the distance along the view axis for a depth (reverse z).
fn distance_from_depth(ndc: f32) -> f32 {
    let slope = view.depth.x - ndc * view.depth.z;
    let offset = view.depth.y - ndc * view.depth.w;
    // With an infinite far plane, the slope is 0 where nothing was drawn.
    return select(FAR_AWAY, offset / slope, abs(slope) > 1e-30 * abs(offset));
}

// Returns a length at this distance along the view axis that takes up the same part of the view at any distance: with
// parallel rays, the distance says nothing about it.
fn length_at(distance: f32) -> f32 {
    return select(abs(distance), view.height, view.height > 0.0);
}

// Returns the depth for a distance along the view axis.
fn depth_from_distance(distance: f32) -> f32 {
    return (view.depth.y - distance * view.depth.x) / (view.depth.w - distance * view.depth.z);
}

// Returns how a point of a prop has moved since the previous frame, as a fraction of the viewport. `at` is the point's
// position in the view, in pixels.
fn motion_of(prop: u32, at: vec2<f32>, depth: f32) -> vec2<f32> {
    let clip = vec4((2.0 * at / vec2<f32>(view.size) - 1.0) * vec2(1.0, -1.0), depth, 1.0);
    let now = view.unjittered_from_clip * clip;
    let before = props[prop].previous_from_clip * clip;
    return (now.xy / now.w - before.xy / before.w) * vec2(0.5, -0.5);
}

const FAR_AWAY: f32 = 1e30;

// Packs the owner of a pixel (1 + its index in `props`, or 0) into two half floats, which hold integers up to 2048
// exactly.
fn pack_owner(owner: u32) -> vec2<f32> {
    return vec2(f32(owner & 2047u), f32(owner >> 11u));
}

// Marks the owner of a posterized pixel whose opacity is less than OPAQUE, as in haze and glass.
const IN_HAZE: u32 = 0x20000u;

// Returns what `pack_owner` packed, without the mark of haze.
fn unpack_owner(texel: vec4<f32>) -> u32 {
    return (u32(texel.r) + (u32(texel.g) << 11u)) & ~IN_HAZE;
}

// Returns whether the owner of a pixel is marked as haze.
fn is_in_haze(texel: vec4<f32>) -> bool {
    return ((u32(texel.g) << 11u) & IN_HAZE) != 0u;
}

// Marks the owner of a pixel that is drawn as trained, which matters only for the lights that fall on it.
const AS_TRAINED: u32 = 0x10000u;

// The opacity from which posterized pixels are opaque. Matches `posterize.rs` of the reference.
const OPAQUE: f32 = 0.9;

// Returns the owner of a posterized pixel, or 0.
fn owner_of(texel: vec4<f32>) -> u32 {
    let owner = unpack_owner(texel);
    return select(owner, 0u, owner >= AS_TRAINED);
}

// Returns the owner of a pixel, posterized or as trained, or 0.
fn prop_of(texel: vec4<f32>) -> u32 {
    return unpack_owner(texel) & (AS_TRAINED - 1u);
}

// Packs the prop that is solid nearest to the camera, and whether it lets no light through. 0 means that there is none.
fn pack_solid(prop: u32, is_opaque: bool) -> u32 {
    return 2u * (prop + 1u) + select(0u, 1u, is_opaque);
}

fn is_solid_prop(texel: u32, prop: u32) -> bool {
    return texel >> 1u == prop + 1u;
}

// Returns whether a prop is solid there, but others show through it.
fn shows_through(texel: u32) -> bool {
    return texel != 0u && (texel & 1u) == 0u;
}

// The smallest depth of a pixel where a prop was drawn. 0 means that there is no prop. Where it is not solid, the depth
// is this, or the result of `pack_haze`.
const LEAST_DEPTH: f32 = 1e-30;
const LEAST_DEPTH_BITS: u32 = 0x0da24260u;
// The smallest depth of a pixel where a prop is solid: its bits are 1 << 27 more.
const LEAST_SOLID_DEPTH: f32 = 6.5536e-26;

// Returns the depth where something is solid, at a distance along the view axis.
fn solid_depth_at_distance(distance: f32) -> f32 {
    return clamp(depth_from_distance(distance), LEAST_SOLID_DEPTH, 1.0);
}

// Returns the depth where a prop is solid. `distance` is along the view axis, from where its rays begin.
fn solid_depth(prop: u32, distance: f32) -> f32 {
    return solid_depth_at_distance(props[prop].near + distance);
}

// Returns whether the depth of a pixel is that of a solid prop.
fn is_solid(depth: f32) -> bool {
    return depth >= LEAST_SOLID_DEPTH;
}

// Returns the largest number for the depth of haze in a view of `props` props.
fn haze_steps(props: u32) -> u32 {
    return min((1u << 27u) / props, 1u << 23u) - 1u;
}

// Packs one of `props` props and the depth of its haze between LEAST_DEPTH and LEAST_SOLID_DEPTH. The root keeps the
// digits of small depths.
fn pack_haze(prop: u32, depth: f32, props: u32) -> f32 {
    let most = haze_steps(props);
    // Roots of GPUs are not exact.
    let root = min(u32(f32(most) * sqrt(sqrt(clamp(depth, 0.0, 1.0)))), most);
    return bitcast<f32>(LEAST_DEPTH_BITS + root * props + prop);
}

fn haze_bits(packed: f32) -> u32 {
    return max(bitcast<u32>(packed), LEAST_DEPTH_BITS) - LEAST_DEPTH_BITS;
}

// Returns the depth that `pack_haze` packed.
fn unpack_haze(packed: f32, props: u32) -> f32 {
    let root = f32(haze_bits(packed) / props) / f32(haze_steps(props));
    return root * root * root * root;
}

// Returns the prop that `pack_haze` packed.
fn haze_prop(packed: f32, props: u32) -> u32 {
    return haze_bits(packed) % props;
}
