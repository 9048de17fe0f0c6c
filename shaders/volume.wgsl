// The volume pass: marches a ray for each pixel of the box around a prop's leaves. See section 2 of the method.

#import bevy_plenoctree::color::{tinted, to_half}
#import bevy_plenoctree::constants::NO_LEAF
#import bevy_plenoctree::octree::{begin, clip, density, field, make_ray, next_leaf}
#import bevy_plenoctree::radiance::{harmonics, radiance}
#import bevy_plenoctree::view::{LEAST_DEPTH, depth_value, pack_owner, props, view, view_distance}

#ifdef MULTISAMPLED
@group(0) @binding(3) var scene_depth: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene_depth: texture_depth_2d;
#endif

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) prop: u32,
}

// Two triangles per face, as corners of the unit cube (bits x, y, z), wound so that the outside is the front.
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
    // Mirroring reverses the winding of the box. Swapping its corners along x restores it.
    let bits = corners[index] ^ props[instance].mirrored;
    let corner = vec3(f32(bits & 1u), f32((bits >> 1u) & 1u), f32(bits >> 2u));
    var position = props[instance].clip_from_box * vec4(corner, 1.0);
    // Only back faces are drawn. They must not be clipped, however near or far they are.
    position.z = 0.5 * position.w;
    return Varying(position, instance);
}

struct Fragment {
    // Encoded sRGB premultiplied by opacity, and opacity.
    @location(0) color: vec4<f32>,
    // The result of `pack_owner`. Blending writes it only where alpha is 1.
    @location(1) owner: vec4<f32>,
    // The depth of the solid part, or of the first leaf if there is no solid part. Props behind it are hidden, whatever
    // the order in which props are drawn. Nearly transparent pixels hide nothing.
    @builtin(frag_depth) depth: f32,
}

// Where a prop's opacity is below this, it hides no other prop, and every prop that is solid there hides it, even from
// behind. Otherwise, floaters would cut holes into other props.
const HARDLY_THERE: f32 = 0.05;

// Returns 1 - exp(-depth), without the cancellation that would erase thin fog.
fn absorbed(depth: f32) -> f32 {
    let series = depth * (1.0 - 0.5 * depth * (1.0 - depth / 3.0 * (1.0 - 0.25 * depth)));
    return select(1.0 - exp(-depth), series, depth < 0.02);
}

@fragment
fn fragment(in: Varying) -> Fragment {
    let at = in.position.xy * view.pixel;
    let point = vec3(1.0, at - props[in.prop].reference);
    let cells = f32(1u << field.depth);
    let toward = props[in.prop].direction * point;
    let length = length(toward);
    let unit = toward / length;
    let ray = make_ray(props[in.prop].origin * point * cells, unit * props[in.prop].scale * cells);

    let span = clip(ray, props[in.prop].low * cells, props[in.prop].high * cells, 0.0);
    let nearest = textureLoad(scene_depth, vec2<u32>(at) + view.corner, 0);
    let end = min(span.y, (view_distance(nearest) - props[in.prop].near) * length);
    if span.x >= end {
        discard;
    }

    var h = harmonics(unit);
    var color = vec3(0.0);
    var opacity = 0.0;
    var transmittance = 1.0;
    var first = -1.0;
    var solid = -1.0;
    var walk = begin(ray, span.x);
    loop {
        if transmittance < view.stop_transmittance {
            break;
        }
        let crossing = next_leaf(ray, &walk, end);
        if crossing.leaf == NO_LEAF {
            break;
        }
        let sigma = density(crossing.leaf);
        let depth = sigma * (crossing.exit - crossing.enter);
        let weight = transmittance * absorbed(depth);
        if weight >= view.min_weight {
            color += weight * radiance(crossing.leaf, &h);
            opacity += weight;
        }
        let before = transmittance;
        transmittance *= exp(-depth);
        first = select(first, crossing.enter, first < 0.0);
        let limit = props[in.prop].solid_transmittance;
        let inside = crossing.enter + max(log(before / limit), 0.0) / sigma;
        solid = select(solid, inside, solid < 0.0 && transmittance <= limit);
    }
    if opacity == 0.0 {
        discard;
    }
    // Leaves that were skipped or not reached take the average color of the others.
    let gone = select(1.0 - transmittance, 1.0, transmittance < view.stop_transmittance);
    if transmittance < view.stop_transmittance || view.min_weight > 0.0 {
        color *= gone / opacity;
        opacity = gone;
    }
    let covers = opacity >= props[in.prop].min_opacity;
    let posterized = select(0u, in.prop + 1u, covers && props[in.prop].colors > 0u);
    if posterized == 0u {
        // Where the prop is posterized, its label is tinted instead, so that a tint does not change the label.
        color = opacity * tinted(color / opacity, props[in.prop].tint);
    }
    let is_solid = solid >= 0.0;
    let distance = props[in.prop].near + select(first, solid, is_solid) / length;
    let depth = clamp(depth_value(distance), LEAST_DEPTH, 1.0);
    return Fragment(
        to_half(vec4(color, opacity)),
        vec4(pack_owner(posterized, is_solid), 0.0, select(0.0, 1.0, covers || is_solid)),
        select(depth, LEAST_DEPTH, opacity < HARDLY_THERE && !is_solid && !covers),
    );
}
