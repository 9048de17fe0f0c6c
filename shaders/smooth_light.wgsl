// The smooth_light pass: smooths the light that falls on props, so that bands end at smooth lines although surfaces
// consist of cells. Rounds it to bands where pixels are posterized. Bind group 0 has the lights.

#import bevy_plenoctree::relief::{MOST_STEEP, center_at, depth, distance_behind, drawn, lit, owner}
#import bevy_plenoctree::shade::{LIGHT_STEPS, LIGHT_ZERO}
#import bevy_plenoctree::view::{is_solid, owner_of, prop_of}

// The result of the lighting pass.
@group(1) @binding(4) var light: texture_2d<f32>;

// The pixels of the disk besides the center: as many as its radius has pixels, within these bounds. And the cosine and
// the sine of the angle between two of them, the golden one: no two are in line.
const LEAST_POINTS: f32 = 20.0;
const MOST_POINTS: f32 = 48.0;
const TURN: vec2<f32> = vec2(-0.7373688, 0.6754903);

// If these are in the middle of one band, and most of them on the prop, the others are not needed. Hues are those of
// these.
const FIRST_POINTS: u32 = 6u;
const ENOUGH_POINTS: u32 = 4u;
const MIDDLE: f32 = 0.1;

// Returns whether light between two values rounds to one band, and is not near the next one.
fn is_one_band(least: f32, most: f32, bands: f32) -> bool {
    return floor(least * bands + 0.5 - MIDDLE) == floor(most * bands + 0.5 + MIDDLE);
}

// Returns the light that is added in a pixel. Negative if light is missing.
fn added(texel: vec4<f32>) -> f32 {
    return (255.0 * texel.a - LIGHT_ZERO) / LIGHT_STEPS;
}

// Rounds added light to bands. Within a pixel of the line between two of them, it is as far between them as the line
// divides the pixel. `slope` is how much the light changes from one pixel to the next.
fn stepped(value: f32, slope: f32, bands: f32) -> f32 {
    let scaled = value * bands;
    let low = floor(scaled);
    let width = clamp(slope * bands, 1e-4, 1.0);
    return (low + saturate((scaled - low - 0.5) / width + 0.5)) / bands;
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let center = center_at(pixel);
    if center.depth == 0.0 {
        discard;
        return vec4(0.0);
    }
    let own = textureLoad(light, pixel, 0);
    if lit[center.prop].brightness == 0.0 {
        return own;
    }
#ifdef POSTERIZED_VIEW
    let in_steps = true;
#else
    let in_steps = owner_of(textureLoad(owner, pixel, 0)) > 0u;
#endif
    let bands = f32(lit[center.prop].bands);
    let reach = MOST_STEEP * center.radius;
    let value = added(own);
    var hues = vec4(own.rgb, 1.0);
    var sum = 0.0;
    var total = 1.0;
    // The sums of the products of differences and offsets, and of offsets with themselves.
    var slope = vec2(0.0);
    var square = vec2(0.0);
    var found_points = 0u;
    var least = 0.0;
    var most = 0.0;
    var direction = vec2(1.0, 0.0);
    // From the border of the disk to its center.
    let points = clamp(center.pixels, LEAST_POINTS, MOST_POINTS);
    for (var i = 0u; f32(i) < points; i++) {
        let is_settled = found_points >= ENOUGH_POINTS && is_one_band(value + least, value + most, bands);
        if i == FIRST_POINTS && in_steps && is_settled {
            break;
        }
        let far = sqrt(1.0 - f32(i) / points);
        let off = vec2<i32>(round(center.pixels * far * direction));
        direction = vec2(dot(direction, vec2(TURN.x, -TURN.y)), dot(direction, TURN.yx));
        let at = clamp(pixel + off, vec2(0), vec2<i32>(drawn.size) - 1);
        let there = textureLoad(depth, at, 0);
        if prop_of(textureLoad(owner, at, 0)) != center.prop + 1u || !is_solid(there) {
            continue;
        }
        if abs(distance_behind(center, at - pixel, there)) > reach {
            continue;
        }
        let found = textureLoad(light, at, 0);
        let weight = 1.0 - 0.75 * far * far;
        let difference = added(found) - value;
        least = min(least, difference);
        most = max(most, difference);
        hues += select(vec4(0.0), vec4(found.rgb, 1.0), i < FIRST_POINTS);
        found_points += 1u;
        sum += weight * difference;
        total += weight;
        slope += weight * difference * vec2<f32>(off);
        square += weight * vec2<f32>(off * off);
    }
    let smooth_value = value + sum / total;
    let steepness = length(slope / max(square, vec2(1.0)));
    return vec4(hues.rgb / hues.w, select(smooth_value, stepped(smooth_value, steepness, bands), in_steps));
}
