// The lighting pass: finds how much of the scene's light is blocked from the solid parts of props by things outside
// their boxes (or nearer, see `self_shadow_distance`), and the color of the rest. Bind group 0 has the lights, as
// Bevy's mesh view has them.
//
// With BRIGHTNESS, it also finds how much light falls on them. The smooth_light pass smooths the result.

#import bevy_pbr::clustered_forward::{
    get_clusterable_object_id, unpack_clusterable_object_index_ranges, view_fragment_cluster_index,
}
#import bevy_pbr::mesh_view_bindings::{clustered_lights, lights, view}
#import bevy_pbr::mesh_view_types::{
    DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT, POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT,
    POINT_LIGHT_FLAGS_SPOT_LIGHT_Y_NEGATIVE,
}
#import bevy_pbr::shadows::{
    fetch_point_shadow, fetch_spot_shadow, get_cascade_index, sample_directional_cascade, world_to_directional_light_local,
}
#import bevy_plenoctree::relief::{Relief, center_at, drawn, lit, relief_at}
#import bevy_plenoctree::shade::{LIGHT_ZERO, LIGHT_STEPS}

// The margin around its box within which a prop casts no shadow on itself, relative to the box.
const MARGIN: f32 = 0.02;

// Returns the distance in a direction from which things cast shadows on a point of the prop: where the point leaves the
// box, if not before.
fn distance_out(prop: u32, point: vec3<f32>, direction: vec3<f32>) -> f32 {
    let at = (lit[prop].box_from_world * vec4(point, 1.0)).xyz;
    let along = (lit[prop].box_from_world * vec4(direction, 0.0)).xyz;
    let safe = select(along, vec3(1e-20), abs(along) < vec3(1e-20));
    let ends = (select(vec3(-MARGIN), vec3(1.0 + MARGIN), safe > vec3(0.0)) - at) / safe;
    return max(min(min(ends.x, min(ends.y, ends.z)), lit[prop].self_shadow_distance), 0.0);
}

// A visible point of a prop.
struct Surface {
    prop: u32,
    point: vec3<f32>,
    view_z: f32,
    // The pixel of the target.
    at: vec2<f32>,
}

// Returns the fraction of a directional light that arrives.
fn share_of_sun(id: u32, surface: Surface) -> f32 {
    if (lights.directional_lights[id].flags & DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) == 0u {
        return 1.0;
    }
    let toward = lights.directional_lights[id].direction_to_light;
    let way = distance_out(surface.prop, surface.point, toward);
    // The point at this distance may be in front of the near plane of a cascade. Cascades for larger distances begin
    // nearer to the light.
    for (var i = get_cascade_index(id, surface.view_z); i < lights.directional_lights[id].num_cascades; i++) {
        let margin = 2.0 * lights.directional_lights[id].cascades[i].texel_size;
        let outside = vec4(surface.point + (way + margin) * toward, 1.0);
        if world_to_directional_light_local(id, i, outside).w > 0.0 {
            return sample_directional_cascade(id, i, outside, vec3(0.0), surface.at);
        }
    }
    return 1.0;
}

#ifdef LAMPS
// Returns the light of a point or spot light that arrives, if nothing blocks it.
fn light_of_lamp(id: u32, surface: Surface, is_spot: bool) -> vec3<f32> {
    let lamp = &clustered_lights.data[id];
    let to_lamp = (*lamp).position_radius.xyz - surface.point;
    let square = dot(to_lamp, to_lamp);
    // The same falloff as that of Bevy's materials.
    let reach = square * (*lamp).color_inverse_square_range.w;
    let fade = saturate(1.0 - reach * reach);
    let light = (*lamp).color_inverse_square_range.rgb * fade * fade / max(square, 1e-4);
    if !is_spot {
        return light;
    }
    let data = (*lamp).light_custom_data;
    let height = sqrt(max(0.0, 1.0 - data.x * data.x - data.y * data.y));
    let is_down = ((*lamp).flags & POINT_LIGHT_FLAGS_SPOT_LIGHT_Y_NEGATIVE) != 0u;
    let axis = vec3(data.x, select(height, -height, is_down), data.y);
    let cone = saturate(dot(-axis, normalize(to_lamp)) * data.z + data.w);
    return light * cone * cone;
}

// Returns the fraction of the light of a point or spot light that arrives.
fn share_of_lamp(id: u32, surface: Surface, is_spot: bool) -> f32 {
    let lamp = &clustered_lights.data[id];
    if ((*lamp).flags & POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) == 0u {
        return 1.0;
    }
    let to_lamp = (*lamp).position_radius.xyz - surface.point;
    let distance = length(to_lamp);
    let toward = to_lamp / distance;
    // Texels grow with the distance.
    let way = distance_out(surface.prop, surface.point, toward) + 0.005 * distance;
    if way >= distance - (*lamp).shadow_map_near_z {
        return 1.0;
    }
    let outside = vec4(surface.point + way * toward, 1.0);
    if is_spot {
        return fetch_spot_shadow(id, outside, vec3(0.0), (*lamp).shadow_map_near_z, surface.at);
    }
    return fetch_point_shadow(id, outside, vec3(0.0), surface.at);
}
#endif

#ifdef BRIGHTNESS
const PI: f32 = 3.1415927;
// What light counts for the hue of a point that it passes by, relative to light that falls on it at a right angle. It
// makes hues fade where surfaces turn away.
const PASSING: f32 = 0.25;
// The share of ambient light that such a surface scatters: the diffuse term of Bevy's `ambient_light`.
const AMBIENT: f32 = 0.45;

// The light that falls on a point.
struct Irradiance {
    // As much as the surface faces it.
    light: vec3<f32>,
    // The same, and a part of what passes by. Only its hue counts.
    hue: vec3<f32>,
}

// Adds the light of a lamp or of the sun to what falls on a point.
fn add_light(sum: ptr<function, Irradiance>, light: vec3<f32>, toward: vec3<f32>, relief: Relief, rim: f32) {
    let cosine = max(dot(relief.normal, toward), 0.0) + rim * max(dot(relief.outward, toward), 0.0);
    (*sum).light += cosine * light;
    (*sum).hue += (cosine + PASSING) * light;
}
#endif

fn luminance(light: vec3<f32>) -> f32 {
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}

// Returns the color of light, whose largest channel is 1.
fn hue(light: vec3<f32>) -> vec3<f32> {
    let brightest = max(light.r, max(light.g, light.b));
    return select(vec3(1.0), light / max(brightest, 1e-30), brightest > 0.0);
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let center = center_at(vec2<i32>(position.xy));
    if center.depth == 0.0 {
        discard;
        return vec4(0.0);
    }
    let prop = center.prop;
    let at = position.xy + vec2<f32>(drawn.corner);
    let point = (view.world_from_view * vec4(center.point, 1.0)).xyz;
    let surface = Surface(prop, point, center.point.z, at);

    var all_light = vec3(0.0);
    var arrives = vec3(0.0);
#ifdef BRIGHTNESS
    var relief = Relief(vec3(0.0), vec3(0.0));
    if lit[prop].brightness > 0.0 {
        relief = relief_at(center);
    }
    var sum = Irradiance(vec3(0.0), vec3(0.0));
#endif
    for (var id = 0u; id < lights.n_directional_lights; id++) {
        let light = lights.directional_lights[id].color.rgb;
        if luminance(light) > 0.0 {
            let arriving = light * share_of_sun(id, surface);
            all_light += light;
            arrives += arriving;
#ifdef BRIGHTNESS
            add_light(&sum, arriving, lights.directional_lights[id].direction_to_light, relief, lit[prop].rim);
#endif
        }
    }
#ifdef LAMPS
    let cluster = view_fragment_cluster_index(surface.at, center.point.z, view.clip_from_view[3].w == 1.0);
    let ranges = unpack_clusterable_object_index_ranges(cluster);
    for (var i = ranges.first_point_light_index_offset; i < ranges.first_reflection_probe_index_offset; i++) {
        let id = get_clusterable_object_id(i);
        let is_spot = i >= ranges.first_spot_light_index_offset;
        let light = light_of_lamp(id, surface, is_spot);
        if luminance(light) > 0.0 {
            let arriving = light * share_of_lamp(id, surface, is_spot);
#ifdef BRIGHTNESS
            let toward = normalize(clustered_lights.data[id].position_radius.xyz - point);
            add_light(&sum, arriving, toward, relief, lit[prop].rim);
            // A lamp that makes props brighter takes nothing away where it is blocked. Where it is not, it makes up for
            // what is blocked of weaker lights.
            all_light += select(light, arriving, lit[prop].brightness > 0.0);
#else
            all_light += light;
#endif
            arrives += arriving;
        }
    }
#endif
    let has_light = luminance(all_light) > 0.0;
    let blocked = select(0.0, 1.0 - luminance(arrives) / max(luminance(all_light), 1e-30), has_light);
#ifdef BRIGHTNESS
    if lit[prop].brightness > 0.0 {
        // As bright as a white surface that scatters all light evenly, as in Bevy's materials.
        let ambient = AMBIENT * lights.ambient_color.rgb;
        let seen = (luminance(sum.light) / PI + luminance(ambient)) * view.exposure;
        let added = 1.0 - exp(-seen);
        let value = (LIGHT_ZERO + LIGHT_STEPS * (added - blocked)) / 255.0;
        return vec4(hue(sum.hue / PI + ambient), value);
    }
#endif
    return vec4(hue(arrives), blocked);
}
