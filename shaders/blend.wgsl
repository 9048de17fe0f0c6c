// The finish pass at the edges of posterized props: smooths them.

#import bevy_plenoctree::color::{decode, encode, tinted}
#import bevy_plenoctree::edge::{FAINTEST, RAYS, bits_of, neighbor, parts_of, word_at}
#import bevy_plenoctree::filter_texel::unpack
#import bevy_plenoctree::ink::{depth, ink_at, inked, surface_at}
#import bevy_plenoctree::labels::{are_tones, assign, place_of_color, shown_opacity}
#import bevy_plenoctree::recolor::recolored_in_tint
#import bevy_plenoctree::shade::shade_of_owner
#import bevy_plenoctree::target::from_target
#import bevy_plenoctree::view::{haze_prop, is_drawn, is_solid, labelings, nearest_drawn, props, share_before, view}

// The results of the label pass. See `ink.wgsl`, too.
@group(1) @binding(0) var shown: texture_2d<f32>;
@group(1) @binding(1) var filtered: texture_2d<u32>;
// The target, before the result is written to it.
@group(1) @binding(3) var scene: texture_2d<f32>;
// The results of the outline pass and of the coverage pass. See `coverage.wgsl`.
@group(3) @binding(0) var outline: texture_2d<u32>;
@group(3) @binding(1) var<storage, read> coverage: array<u32>;
@group(3) @binding(2) var own_rays: texture_2d<f32>;
@group(3) @binding(3) var other_rays: texture_2d<f32>;
@group(3) @binding(4) var layer: texture_2d<f32>;

// What is behind the owners of a pixel's parts.
struct Behind {
    // In linear light, with opacity.
    shown: vec4<f32>,
    // The same without the haze of the owners, which is not behind them: what shows through an owner.
    bare: vec4<f32>,
    // Before it is posterized, in encoded sRGB.
    composite: vec3<f32>,
}

// Returns the scene at a pixel, in encoded sRGB.
fn scene_at(pixel: vec2<u32>) -> vec3<f32> {
    return from_target(textureLoad(scene, pixel + view.corner, 0).rgb);
}

// Returns the bits of a pixel's rays, as in `coverage.wgsl`.
fn rays_at(pixel: vec2<u32>) -> vec4<u32> {
    return bits_of(textureLoad(outline, pixel, 0).xy, coverage[word_at(pixel, view.size.x)]);
}

// Returns whether all that a pixel sees of props is haze of one of two owners.
fn is_haze_of(owners: vec2<u32>, pixel: vec2<u32>) -> bool {
    let found = textureLoad(depth, pixel, 0);
    return found > 0.0 && !is_solid(found) && any(owners == vec2(haze_prop(found, view.props) + 1u));
}

// `beside` are the owners of the pixel behind which this one is seen.
fn behind_at(pixel: vec2<u32>, beside: vec2<u32>) -> Behind {
    let value = unpack(textureLoad(filtered, pixel, 0));
    let seen = textureLoad(shown, pixel, 0);
    // Where nothing is drawn, the composite is the scene.
    let alpha = max(seen.a, 0.0);
    let shown = vec4(decode(select(value.color, seen.rgb, seen.a >= 0.0)), alpha);
    var behind = Behind(shown, shown, value.color);
    if is_haze_of(beside, pixel) {
        behind.bare = vec4(decode(scene_at(pixel)), 0.0);
    }
    let owners = textureLoad(outline, pixel, 0).xy;
    let thinned = textureLoad(own_rays, pixel, 0);
    // See `thinned` of `edge.wgsl`.
    if value.owner == 0u && owners.x == 0u && owners.y > 0u && thinned.a > 0.0 {
        behind.composite = max(thinned.rgb + thinned.a * value.color, vec3(0.0));
        var thin = behind.composite;
        let prop = owners.y - 1u;
        if labelings[prop].recolors == 1u {
            // What the rays see of the prop. See `thinned`.
            let center = textureLoad(layer, pixel, 0);
            let rays = vec4(thinned.rgb + thinned.a * center.rgb, 1.0 - thinned.a * (1.0 - center.a));
            let own = rays.rgb / max(rays.a, 1e-6);
            thin = max(thin + rays.a * (recolored_in_tint(prop, own) - own), vec3(0.0));
        }
        behind.shown = vec4(decode(thin), 1.0 - thinned.a * (1.0 - alpha));
    }
    return behind;
}

// What the neighbors of a pixel show.
struct Around {
    // What those show that none of the pixel's owners owns, if there are any.
    behind: Behind,
    is_known: bool,
    // What the others show, in linear light, with opacity: the sum, weighted by `BESIDE` and `ACROSS`.
    shown: vec4<f32>,
    // What the one shows that sees most of an owner.
    most: vec4<f32>,
    // The weights of all but those.
    rest: f32,
}

// How much the center of a pixel counts for what the pixel shows, relative to a ray, and how much a neighbor does that
// shares a side with the pixel or a corner.
const CENTER: f32 = 0.8;
const BESIDE: f32 = 0.1;
const ACROSS: f32 = 0.025;
const NEIGHBORS: f32 = 4.0 * (BESIDE + ACROSS);

fn around(pixel: vec2<u32>, owners: vec2<u32>, ink: vec2<f32>) -> Around {
    var found = Around(Behind(vec4(0.0), vec4(0.0), vec3(0.0)), false, vec4(0.0), vec4(0.0), NEIGHBORS);
    var total = 0.0;
    var most = 0.0;
    for (var i = 0; i < 8; i++) {
        let at = vec2<u32>(neighbor(vec2<i32>(pixel), i));
        if is_drawn(at) {
            let there = behind_at(at, owners);
            let own = unpack(textureLoad(filtered, at, 0)).owner;
            if own == 0u || all(vec2(own) != owners) {
                // A neighbor that the edge of a mesh crosses counts less.
                let rays = rays_at(at);
                let share = 1.0 + f32(RAYS - countOneBits(rays.r | rays.b));
                let weight = share * share;
                found.behind.shown += weight * there.shown;
                found.behind.bare += weight * there.bare;
                found.behind.composite += weight * there.composite;
                total += weight;
            } else {
                let near = select(BESIDE, ACROSS, i > 3);
                let shown = with_ink(own, there.shown, select(ink.y, ink.x, own == owners.x));
                found.shown += near * shown;
                found.rest -= near;
                let opacity = textureLoad(layer, at, 0).a;
                found.most = select(found.most, shown, opacity > most);
                most = max(most, opacity);
            }
        }
    }
    found.is_known = total > 0.0;
    found.behind.shown /= max(total, 1.0);
    found.behind.bare /= max(total, 1.0);
    found.behind.composite /= max(total, 1.0);
    return found;
}

#ifdef RESOLVED
// Returns the scene behind the props at the edge of a mesh before them, in linear light: what neighbors show without the
// mesh, or else what is left of the pixel without what neighbors show of the mesh. The last channel is 0 if neither is
// known.
fn scene_behind(pixel: vec2<u32>, mixed: vec3<f32>) -> vec4<f32> {
    var solid = textureLoad(depth, pixel, 0);
    for (var i = 0; i < 8; i++) {
        solid = max(solid, textureLoad(depth, nearest_drawn(neighbor(vec2<i32>(pixel), i)), 0));
    }
    let has_depth = is_solid(solid);
    var behind = vec4(0.0);
    var mesh = vec4(0.0);
    for (var i = 0; i < 8; i++) {
        let at = vec2<u32>(neighbor(vec2<i32>(pixel), i));
        if is_drawn(at) {
            // Where the props have no depth, their own pixels know whether anything is before them.
            let hidden = rays_at(at).a;
            let is_clear = hidden == 0u && unpack(textureLoad(filtered, at, 0)).owner > 0u;
            let share = select(select(0.5, 0.0, is_clear), share_before(at, solid), has_depth);
            let color = vec4(decode(scene_at(at)), 1.0);
            behind += select(vec4(0.0), color, share == 0.0);
            mesh += select(vec4(0.0), color, share == 1.0);
        }
    }
    if behind.a > 0.0 || mesh.a == 0.0 {
        return behind / max(behind.a, 1.0);
    }
    let share = min(share_before(pixel, solid), 0.99);
    return vec4(max((mixed - share * mesh.rgb / mesh.a) / (1.0 - share), vec3(0.0)), 1.0);
}
#endif

// Returns what rays show of their owner: the label of their mean color, in linear light, with opacity. Ink covers a part of
// the pixel.
fn posterized(pixel: vec2<u32>, rays: vec4<f32>, owner: u32, behind: Behind, ink: f32) -> vec4<f32> {
    let composite = rays.rgb + max(1.0 - rays.a, 0.0) * behind.composite;
    let over = select(composite, rays.rgb / max(rays.a, 1e-6), are_tones(owner - 1u));
    let shade = shade_of_owner(pixel, owner);
    let label = assign(place_of_color(owner - 1u, over), owner - 1u, shade.light);
    let color = tinted(label.color, props[owner - 1u].tint * shade.tint);
    // What shows through is blended in encoded sRGB, as within pixels that are not at edges.
    let opacity = shown_opacity(owner - 1u, rays.a);
    let seen = decode(mix(encode(behind.bare.rgb), color, opacity));
    return with_ink(owner, vec4(seen, mix(behind.bare.a, 1.0, opacity)), ink);
}

// Returns what is seen of an owner, in linear light, with opacity, with ink that covers a part of it.
fn with_ink(owner: u32, shown: vec4<f32>, part: f32) -> vec4<f32> {
#ifdef INK
    return vec4(inked(owner - 1u, props[owner - 1u].tint, shown.rgb, part), mix(shown.a, 1.0, part));
#else
    return shown;
#endif
}

// Returns the part of a pixel that lines of one of its owners cover, or 0 if there is no such owner.
fn ink_of(pixel: vec2<u32>, owner: u32) -> f32 {
#ifdef INK
    if owner > 0u {
        let at = pixel_of(pixel, owner);
        var center = surface_at(at);
        center.owner = select(0u, owner, center.owner == owner);
        return ink_at(vec2<i32>(pixel), center, textureLoad(shown, at, 0).a >= 1.0);
    }
#endif
    return 0.0;
}

#ifdef INK
// Returns the pixel that shows what a pixel at an edge sees of one of its owners: itself or the neighbor that sees what is
// nearest of it.
fn pixel_of(pixel: vec2<u32>, owner: u32) -> vec2<i32> {
    var nearest = surface_at(vec2<i32>(pixel));
    var found = vec2<i32>(pixel);
    for (var i = 0; i < 8; i++) {
        let at = nearest_drawn(neighbor(vec2<i32>(pixel), i));
        let there = surface_at(at);
        if there.owner == owner && (nearest.owner != owner || there.distance < nearest.distance) {
            nearest = there;
            found = at;
        }
    }
    return found;
}
#endif

// Returns the parts of a pixel, blended in linear light as multisampling does: encoded sRGB, and opacity. Draws nothing
// where there is nothing to smooth.
@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let owners = textureLoad(outline, pixel, 0).xy;
    let bits = rays_at(pixel);
    let parts = parts_of(owners, bits);
    let count = parts.own + parts.other + parts.rest;
    let has_other = owners.y > 0u;
    let most = max(max(parts.own, parts.other), parts.rest);
    // Where all eight rays see the same owner, neighbors would only blur what they found.
    let is_sure = view.edge_rays == RAYS && (most == count || (!has_other && parts.rest == 0u));
    if is_sure && parts.is_center && parts.rest == count {
        discard;
    }
    let center = behind_at(pixel, owners);
    let ink = vec2(ink_of(pixel, owners.x), ink_of(pixel, owners.y));
    let around = around(pixel, owners, ink);
    let own = textureLoad(own_rays, pixel, 0);
    let other = textureLoad(other_rays, pixel, 0);
    let is_slit = !has_other && !around.is_known;
    if is_slit && parts.rest == 0u && 1.0 - own.a - other.a < FAINTEST {
        discard;
    }
    var behind = center;
    if !parts.is_center {
        if around.is_known {
            behind = around.behind;
        } else if is_slit {
            let color = scene_at(pixel);
            let bare = vec4(decode(color), 0.0);
            behind = Behind(bare, bare, color);
        }
    }
    // What parts of props show, and how much what is behind them and the center count.
    var at_center = behind.shown;
    if owners.x > 0u {
        at_center = with_ink(owners.x, center.shown, ink.x);
    }
    var own_parts = vec4(0.0);
    var of_behind = f32(parts.rest);
    var of_center = 0.0;
    // Without rays, there is no color to find a label for. See `estimate` of `edge_owners.wgsl`.
    if parts.own > 0u {
        let rays = own * f32(RAYS) / f32(countOneBits(bits.r));
        var seen = at_center;
        if rays.a > 0.0 {
            seen = posterized(pixel, rays, owners.x, behind, ink.x);
        }
        own_parts += f32(parts.own) * seen;
    }
    if parts.other > 0u {
        let rays = other * f32(RAYS) / f32(countOneBits(bits.b));
        let owner = select(owners.x, owners.y, has_other);
        var seen = around.most;
        if rays.a > 0.0 {
            seen = posterized(pixel, rays, owner, behind, select(ink.x, ink.y, has_other));
        }
        own_parts += f32(parts.other) * seen;
    }
    var total = f32(count);
    if bits.a == 0u {
        // Of four rays, each stands for two.
        let ray = f32(RAYS) / f32(view.edge_rays);
        of_center = ray * CENTER;
        total += ray * CENTER;
        if !is_sure {
            own_parts += ray * around.shown;
            of_behind += ray * around.rest;
            total += ray * NEIGHBORS;
        }
    }
    var sum = (own_parts + of_behind * behind.shown + of_center * at_center) / max(total, 1.0);
#ifdef RESOLVED
    if bits.a != 0u {
        // The target mixes a mesh before the props with what is behind them, which they replace.
        let mixed = decode(scene_at(pixel));
        let beyond = scene_behind(pixel, mixed);
        let covered = f32(parts.own + parts.other) / f32(count);
        let replaced = own_parts / f32(count) + vec4(max(mixed - covered * beyond.rgb, vec3(0.0)), 0.0);
        sum = select(sum, replaced, beyond.a > 0.0);
    }
#endif
    if textureLoad(shown, pixel, 0).a < 0.0 && sum.a == 0.0 {
        discard;
    }
    return vec4(encode(sum.rgb), sum.a);
}
