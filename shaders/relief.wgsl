// The surface of a prop around a pixel: its depth, and where it faces. Uses the bind groups of the lighting pass and the
// smooth_light pass.
#define_import_path bevy_plenoctree::relief

#import bevy_pbr::mesh_view_bindings::view
#import bevy_plenoctree::shade::Lit
#import bevy_plenoctree::view::{View, is_solid, prop_of}

@group(1) @binding(0) var<storage, read> lit: array<Lit>;
// The part of the viewport that is drawn.
@group(1) @binding(1) var<uniform> drawn: View;
@group(1) @binding(2) var depth: texture_depth_2d;
@group(1) @binding(3) var owner: texture_2d<f32>;

// A point of a prop, and the disk around it in which its surface is smoothed.
struct Center {
    pixel: vec2<i32>,
    prop: u32,
    depth: f32,
    // In the camera's space, and the same in homogeneous coordinates.
    point: vec3<f32>,
    place: vec4<f32>,
    // How those change from pixel to pixel.
    across: vec4<f32>,
    down: vec4<f32>,
    // The radius of the disk, in pixels and in the scene.
    pixels: f32,
    radius: f32,
}

// The least and the largest radius of the disk, in pixels.
const LEAST_PIXELS: f32 = 2.0;
const MOST_PIXELS: f32 = 64.0;

// Returns the point in another pixel that has the depth of the center, in homogeneous coordinates of the camera's
// space.
fn flat_place(center: Center, off: vec2<i32>) -> vec4<f32> {
    return center.place + f32(off.x) * center.across + f32(off.y) * center.down;
}

// Returns how far a depth in another pixel is behind the center, along the view axis.
fn distance_behind(center: Center, off: vec2<i32>, depth: f32) -> f32 {
    let place = flat_place(center, off).zw + (depth - center.depth) * view.view_from_clip[2].zw;
    return center.point.z - place.x / place.y;
}

// Returns the disk around the point of a prop that a pixel of the drawn part of the view shows. Its depth is 0 if no light
// falls there.
fn center_at(pixel: vec2<i32>) -> Center {
    let owned = prop_of(textureLoad(owner, pixel, 0));
    let prop = max(owned, 1u) - 1u;
    if owned == 0u || lit[prop].bands == 0u {
        return Center();
    }
    let solid = depth_near(pixel, owned);
    if solid == 0.0 {
        return Center();
    }
    let per_pixel = vec2(2.0, -2.0) / view.main_pass_viewport.zw;
    let at = vec2<f32>(pixel) + 0.5 + vec2<f32>(drawn.corner) - view.main_pass_viewport.xy;
    let place = view.view_from_clip * vec4(at * per_pixel + vec2(-1.0, 1.0), solid, 1.0);
    let point = place.xyz / place.w;
    let w = (view.clip_from_view * vec4(point, 1.0)).w;
    let scale = 0.5 * view.main_pass_viewport.w * abs(view.clip_from_view[1][1]) / max(w, 1e-20);
    let pixels = clamp(lit[prop].radius * scale, LEAST_PIXELS, MOST_PIXELS);
    let across = per_pixel.x * view.view_from_clip[0];
    let down = per_pixel.y * view.view_from_clip[1];
    return Center(pixel, prop, solid, point, place, across, down, pixels, pixels / scale);
}

// Where a surface faces.
struct Relief {
    // In the scene. Its length is 1.
    normal: vec3<f32>,
    // Where the prop ends nearby, in the scene. Its length grows to 1 at the end.
    outward: vec3<f32>,
}

// Half of the points of the ring, and the cosine and the sine of the angle between two of them.
const PAIRS: i32 = 6;
const TURN: vec2<f32> = vec2(0.8660254, 0.5);
// The sum of the points of a half ring with a radius of 1.
const HALF_RING: f32 = 3.8637;

// How much the distance may change over the radius of the disk. If it changes more, the surface breaks.
const MOST_STEEP: f32 = 4.0;

// A point of the ring, relative to the center.
struct Neighbor {
    offset: vec3<f32>,
    // The same, at the depth of the center.
    flat_offset: vec3<f32>,
    is_own: bool,
    // Whether the prop ends before it.
    is_beyond: bool,
}

fn neighbor_at(center: Center, off: vec2<i32>) -> Neighbor {
    let pixel = center.pixel + off;
    let at = clamp(pixel, vec2(0), vec2<i32>(drawn.size) - 1);
    let is_inside = all(at == pixel);
    let found = textureLoad(depth, at, 0);
    let is_own = is_inside && is_solid(found) && prop_of(textureLoad(owner, at, 0)) == center.prop + 1u;
    let flat = flat_place(center, off);
    let place = flat + select(0.0, found - center.depth, is_own) * view.view_from_clip[2];
    let is_beyond = is_inside && !is_own && found < center.depth;
    return Neighbor(place.xyz / place.w - center.point, flat.xyz / flat.w - center.point, is_own, is_beyond);
}

// Returns where the surface faces, smoothed over the disk: the area vector of the ring around it, which is the integral
// of the normal. Where the surface ends or breaks, it goes on as on the other side of the center.
fn relief_at(center: Center) -> Relief {
    let most = MOST_STEEP * center.radius;
    var direction = vec2(1.0, 0.0);
    var area = vec3(0.0);
    var outward = vec2(0.0);
    // The first points on both sides of the center, and the last ones.
    var first = array(vec3(0.0), vec3(0.0));
    var last = array(vec3(0.0), vec3(0.0));
    for (var i = 0; i < PAIRS; i++) {
        let off = vec2<i32>(round(center.pixels * direction));
        let one = neighbor_at(center, off);
        let other = neighbor_at(center, -off);
        let is_even = one.is_own && other.is_own && abs(one.offset.z + other.offset.z) <= most;
        // Round surfaces are steep at their outline.
        let keeps_one = is_even || (one.is_own && abs(one.offset.z) <= select(2.0 * most, most, other.is_own));
        let keeps_other = is_even || (other.is_own && abs(other.offset.z) <= select(2.0 * most, most, one.is_own));
        let a = select(select(one.flat_offset, -other.offset, keeps_other), one.offset, keeps_one);
        let b = select(select(other.flat_offset, -one.offset, keeps_one), other.offset, keeps_other);
        area += cross(last[0], a) + cross(last[1], b);
        if i == 0 {
            first = array(a, b);
        }
        last = array(a, b);
        let one_ends = one.is_beyond || (one.is_own && !keeps_one && one.offset.z < 0.0);
        let other_ends = other.is_beyond || (other.is_own && !keeps_other && other.offset.z < 0.0);
        outward += direction * (select(0.0, 1.0, one_ends) - select(0.0, 1.0, other_ends));
        direction = vec2(dot(direction, vec2(TURN.x, -TURN.y)), dot(direction, TURN.yx));
    }
    area += cross(last[0], first[1]) + cross(last[1], first[0]);
    // Seen from the camera, the points run clockwise, unless the projection mirrors.
    let x = view.clip_from_view[0].xy;
    let y = view.clip_from_view[1].xy;
    let turn = select(-1.0, 1.0, x.x * y.y < x.y * y.x);
    let facing = (view.world_from_view * vec4(turn * area, 0.0)).xyz;
    let away = (view.world_from_view * vec4(outward * sign(vec2(x.x, -y.y)) / HALF_RING, 0.0, 0.0)).xyz;
    return Relief(facing / max(length(facing), 1e-30), away / max(length(away), 1.0));
}

// The largest distance at which a pixel that is not solid takes the depth of a solid one, in pixels.
const REACH: i32 = 3;

// Returns the depth of a pixel, or that of a solid pixel of the same prop nearby: outlines are drawn where a prop is
// not solid yet, and must get as dark as what they outline. Returns 0 if there is none.
fn depth_near(pixel: vec2<i32>, owned: u32) -> f32 {
    var found = textureLoad(depth, pixel, 0);
    for (var i = 0; i < 8 * REACH; i++) {
        if i % 8 == 0 && is_solid(found) {
            break;
        }
        let side = i % 8 + select(0, 1, i % 8 > 3);
        let at = clamp(pixel + (i / 8 + 1) * vec2(side % 3 - 1, side / 3 - 1), vec2(0), vec2<i32>(drawn.size) - 1);
        let there = textureLoad(depth, at, 0);
        found = max(found, select(0.0, there, prop_of(textureLoad(owner, at, 0)) == owned));
    }
    return select(0.0, found, is_solid(found));
}
