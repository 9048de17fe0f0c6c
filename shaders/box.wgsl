// The box around a prop's leaves, for the passes that march a ray for each of its pixels.

#import bevy_plenoctree::prop_ray::Varying
#import bevy_plenoctree::view::{NOWHERE, first_drawn, props, view}

// Two triangles per face, as corners of the unit cube (bits x, y, z), wound so that the outside is the front.
const CORNERS = array<u32, 36>(
    0u, 4u, 6u, 0u, 6u, 2u, // x low
    1u, 3u, 7u, 1u, 7u, 5u, // x high
    0u, 1u, 5u, 0u, 5u, 4u, // y low
    2u, 6u, 7u, 2u, 7u, 3u, // y high
    0u, 2u, 3u, 0u, 3u, 1u, // z low
    4u, 5u, 7u, 4u, 7u, 6u, // z high
);

// Returns the place in the target of a point of the viewport, in clip space. The rays of the grid go through the
// centers of every `spacing`-th pixel, the first one among them.
fn to_grid(position: vec4<f32>) -> vec2<f32> {
    let spacing = f32(view.spacing);
    let pixels = vec2<f32>((view.size + view.spacing - 1u) / view.spacing);
    let scale = vec2<f32>(view.size) / (spacing * pixels);
    let shift = scale - 1.0 + (1.0 - 1.0 / spacing) / pixels;
    return scale * position.xy + shift * vec2(1.0, -1.0) * position.w;
}

// An instance is a prop and, above its 16 bits, the part of the rays to draw.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Varying {
    let prop = instance & 0xffffu;
    if first_drawn > 0u {
        return Varying(NOWHERE, prop, 0u);
    }
    var corners = CORNERS;
    // Mirroring reverses the winding of the box. Swapping its corners along x restores it.
    let bits = corners[index] ^ props[prop].mirrored;
    let corner = vec3(f32(bits & 1u), f32((bits >> 1u) & 1u), f32(bits >> 2u));
    var position = props[prop].clip_from_box * vec4(corner, 1.0);
    // Only back faces are drawn. They must not be clipped, no matter how near or far they are.
    position.z = 0.5 * position.w;
    position = vec4(to_grid(position), position.zw);
    return Varying(position, prop, instance >> 16u);
}
