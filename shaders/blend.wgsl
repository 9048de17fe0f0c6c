// The blend pass: smooths the edges of posterized props.

#import bevy_plenoctree::color::{decode, encode, tinted}
#import bevy_plenoctree::edge::{RAYS, bits_of, neighbor, parts_of}
#import bevy_plenoctree::filter_texel::unpack
#import bevy_plenoctree::labels::assign
#ifdef LIGHTING
#import bevy_plenoctree::shade::shade_of
#endif
#import bevy_plenoctree::view::{is_drawn, props, view}

// The result of the label pass.
@group(1) @binding(0) var shown: texture_2d<f32>;
@group(1) @binding(1) var filtered: texture_2d<u32>;
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

fn behind_at(pixel: vec2<u32>) -> Behind {
    let value = unpack(textureLoad(filtered, pixel, 0));
    let seen = textureLoad(shown, pixel, 0);
    // Where nothing is drawn, the composite is the scene.
    let alpha = max(seen.a, 0.0);
    var behind = Behind(vec4(decode(select(value.color, seen.rgb, seen.a >= 0.0)), alpha), value.color);
    let owners = textureLoad(outline, pixel, 0).xy;
    let thinned = textureLoad(own_rays, pixel, 0);
    // See `thinned` of `coverage.wgsl`.
    if value.owner == 0u && owners.x == 0u && owners.y > 0u && thinned.a > 0.0 {
        behind.composite = max(thinned.rgb + thinned.a * value.color, vec3(0.0));
        behind.shown = vec4(decode(behind.composite), 1.0 - thinned.a * (1.0 - alpha));
    }
    return behind;
}

// Returns what the neighbors that none of the owners owns show, or `center` if there are none.
fn around(pixel: vec2<u32>, owners: vec2<u32>, center: Behind) -> Behind {
    var sum = Behind(vec4(0.0), vec3(0.0));
    var total = 0.0;
    for (var i = 0; i < 8; i++) {
        let at = vec2<u32>(neighbor(vec2<i32>(pixel), i));
        if is_drawn(at) {
            let own = unpack(textureLoad(filtered, at, 0)).owner;
            if own == 0u || all(vec2(own) != owners) {
                let behind = behind_at(at);
                // A neighbor that the edge of a mesh crosses counts less.
                let rays = bits_of(textureLoad(outline, at, 0).xy, textureLoad(coverage, at, 0));
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
fn posterized(pixel: vec2<u32>, rays: vec4<f32>, owner: u32, behind: vec3<f32>) -> vec3<f32> {
    let over = rays.rgb + max(1.0 - rays.a, 0.0) * behind;
    var tint = props[owner - 1u].tint;
    var missing = 0.0;
#ifdef LIGHTING
    let shade = shade_of(pixel, owner - 1u, true);
    tint *= shade.tint;
    missing = shade.missing;
#endif
    return decode(tinted(assign(over, owner - 1u, missing).color, tint));
}

// Returns the parts of a pixel, blended in linear light as multisampling does.
@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let seen = textureLoad(shown, pixel, 0);
    let owners = textureLoad(outline, pixel, 0).xy;
    let bits = bits_of(owners, textureLoad(coverage, pixel, 0));
    let parts = parts_of(owners, bits);
    if parts.are_whole {
        return seen;
    }
    let center = behind_at(pixel);
    var behind = center;
    if !parts.is_center {
        behind = around(pixel, owners, center);
    }
    // With four rays, the one through the center is a fifth. Each counts as two of eight.
    let share = select(0u, 2u, view.edge_rays < RAYS);
    var sum = f32(parts.rest) * behind.shown;
    sum += f32(share) * vec4(center.shown.rgb, select(center.shown.a, 1.0, owners.x > 0u));
    if parts.own > 0u {
        let rays = textureLoad(own_rays, pixel, 0) * f32(RAYS) / f32(countOneBits(bits.r));
        sum += f32(parts.own) * vec4(posterized(pixel, rays, owners.x, behind.composite), 1.0);
    }
    if parts.other > 0u {
        let rays = textureLoad(other_rays, pixel, 0) * f32(RAYS) / f32(countOneBits(bits.b));
        sum += f32(parts.other) * vec4(posterized(pixel, rays, owners.y, behind.composite), 1.0);
    }
    sum /= f32(max(parts.own + parts.other + parts.rest + share, 1u));
    return select(vec4(encode(sum.rgb), sum.a), seen, seen.a < 0.0 && sum.a == 0.0);
}
