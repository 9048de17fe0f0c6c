// The volume pass: section 2 of the method, for the pixels of the box around a prop's leaves.

#import bevy_plenoctree::color::to_half
#import bevy_plenoctree::octree::{LEAF, advance, begin, clip, densities, field, is_inside, make_ray}
#import bevy_plenoctree::radiance::{harmonics, radiance}
#import bevy_plenoctree::view::{FAR_AWAY, pack_distance, props, view, view_distance}

#ifdef MULTISAMPLED
@group(0) @binding(3) var scene_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene_depth: texture_depth_2d;
#endif

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) prop: u32,
}

// Two triangles a face, as corners of the unit cube (bits x, y, z), wound so that the outside faces front.
const CORNERS = array<u32, 36>(
    0u, 4u, 6u, 0u, 6u, 2u, // x low
    1u, 3u, 7u, 1u, 7u, 5u, // x high
    0u, 1u, 5u, 0u, 5u, 4u, // y low
    2u, 6u, 7u, 2u, 7u, 3u, // y high
    0u, 2u, 3u, 0u, 3u, 1u, // z low
    4u, 5u, 7u, 4u, 7u, 6u, // z high
);

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Varying {
    var corners = CORNERS;
    // A mirrored box is wound the other way round, unless its corners are swapped too.
    let bits = corners[index] ^ props[instance].mirrored;
    let corner = vec3(f32(bits & 1u), f32((bits >> 1u) & 1u), f32(bits >> 2u));
    var position = props[instance].clip_from_box * vec4(corner, 1.0);
    // Back faces stand for the box. They must not be clipped, however near or far they are.
    position.z = 0.5 * position.w;
    return Varying(position, instance);
}

struct Fragment {
    // Colour weighed by opacity, encoded sRGB, and opacity.
    @location(0) color: vec4<f32>,
    // 1 + index of the prop that posterises the pixel, or 0; blending takes it where alpha is 1.
    @location(1) owner: vec4<f32>,
    // What `pack_distance` makes of where half of the light is gone; taken likewise.
    @location(2) distance: vec4<f32>,
}

const STOP_TRANSMITTANCE: f32 = 1e-2;

// 1 - exp(-depth) without the cancellation that eats thin fog.
fn absorbed(depth: f32) -> f32 {
    let series = depth * (1.0 - 0.5 * depth * (1.0 - depth / 3.0 * (1.0 - 0.25 * depth)));
    return select(1.0 - exp(-depth), series, depth < 0.02);
}

@fragment
fn fragment(in: Varying) -> Fragment {
    let point = vec3(1.0, in.position.xy);
    let cells = f32(1u << field.depth);
    let toward = props[in.prop].direction * point;
    let unit = normalize(toward);
    let ray = make_ray(props[in.prop].origin * point * cells, unit * props[in.prop].scale * cells);

    let span = clip(ray, props[in.prop].low * cells, props[in.prop].high * cells);
    let nearest = textureLoad(scene_depth, vec2<u32>(in.position.xy) + view.corner, 0);
    let end = min(span.y, view_distance(nearest) * length(toward));
    if span.x >= end {
        discard;
    }

    var h = harmonics(unit);
    var color = vec3(0.0);
    var opacity = 0.0;
    var transmittance = 1.0;
    var half_way = FAR_AWAY;
    var walk = begin(ray, span.x);
    loop {
        let start = walk.t;
        let step = advance(ray, &walk);
        if (step.cell & LEAF) != 0u {
            let leaf = step.cell & ~LEAF;
            let depth = densities[leaf] * (min(step.exit, end) - start);
            let weight = transmittance * absorbed(depth);
            color += weight * radiance(leaf, &h);
            opacity += weight;
            let before = transmittance;
            transmittance *= exp(-depth);
            if before > 0.5 && transmittance <= 0.5 {
                half_way = start + log(2.0 * before) / densities[leaf];
            }
            if transmittance < STOP_TRANSMITTANCE {
                break;
            }
        }
        if step.exit >= end || !is_inside(walk) {
            break;
        }
    }

    if transmittance < STOP_TRANSMITTANCE {
        color /= opacity;
        opacity = 1.0;
    }
    let covers = select(0.0, 1.0, opacity > 0.0 && opacity >= props[in.prop].min_opacity);
    let posterized = select(0.0, f32(in.prop + 1u), props[in.prop].colors > 0u);
    let solid = select(0.0, 1.0, half_way < FAR_AWAY);
    return Fragment(
        to_half(vec4(color, opacity)),
        vec4(posterized, 0.0, 0.0, covers),
        vec4(pack_distance(select(FAR_AWAY, half_way / length(toward), solid > 0.0)), 0.0, solid),
    );
}
