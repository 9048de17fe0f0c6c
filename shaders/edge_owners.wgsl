// Finds the pixels at the edges of posterized props, and the props that may cover parts of them.
#define_import_path bevy_plenoctree::edge_owners

#import bevy_plenoctree::edge::{MASK_OF_PROPS, MASK_OF_RAYS, neighbor}
#ifdef ESTIMATES
#import bevy_plenoctree::edge::MASK_OF_ESTIMATES
#import bevy_plenoctree::edge_opacity::{is_cut, opacity_around}
#endif
#import bevy_plenoctree::view::{
    SMOOTHS_NOTHING, SMOOTHS_SLITS, is_drawn, is_solid, owner_of, props, screen, unpack_owner,
}

// A pixel, and whether it is at an edge.
struct Edge {
    // The owner of the pixel, and the nearest other owner of a neighbor. 0 if there is none, or its edges stay hard. Both
    // are 0 away from edges.
    owners: vec2<u32>,
    // What the depth test of later passes compares with.
    mask: f32,
}

fn smooths(owner: u32) -> bool {
    return owner > 0u && props[max(owner, 1u) - 1u].smooths > SMOOTHS_NOTHING;
}

// What lets less light through is no slit.
const LEAST_TRANSMITTANCE: f32 = 0.02;

// Returns whether the center of a pixel sees a part of a slit: a neighbor lets less than half as much light through. In
// fog, neighbors differ less.
fn is_at_slit(layer: texture_2d<f32>, pixel: vec2<i32>) -> bool {
    let transmittance = 1.0 - textureLoad(layer, pixel, 0).a;
    var least = transmittance;
    let neighbors = select(0, 8, transmittance > LEAST_TRANSMITTANCE);
    for (var i = 0; i < neighbors; i++) {
        let at = neighbor(pixel, i);
        if is_drawn(vec2<u32>(at)) {
            least = min(least, 1.0 - textureLoad(layer, at, 0).a);
        }
    }
    return 2.0 * least < transmittance;
}

// Returns whether a pixel is at an edge, and of which props.
fn edge_at(
    layer: texture_2d<f32>,
    owner: texture_2d<f32>,
    depth: texture_depth_2d,
    pixel: vec2<i32>,
) -> Edge {
    let texel = textureLoad(owner, pixel, 0);
    let own = owner_of(texel);
    let owned = unpack_owner(texel);
    let solid_here = textureLoad(depth, pixel, 0);
    // A posterized view shows all of its pixels.
    let inside = select(0.0, MASK_OF_PROPS, solid_here > 0.0 || screen.view_posterize > 0u);
    var differs = false;
    for (var i = 0; i < 8; i++) {
        let at = neighbor(pixel, i);
        differs = differs || (is_drawn(vec2<u32>(at)) && unpack_owner(textureLoad(owner, at, 0)) != owned);
    }
    var ends = false;
    var other = 0u;
    var nearest = 0.0;
    let neighbors = select(0, 8, differs);
    for (var i = 0; i < neighbors; i++) {
        let at = neighbor(pixel, i);
        if is_drawn(vec2<u32>(at)) {
            let there = owner_of(textureLoad(owner, at, 0));
            ends = ends || there != own;
            if there != own && smooths(there) {
                let solid = textureLoad(depth, at, 0);
                // Where neither is solid, the one that is drawn later is in front.
                if solid > nearest || (solid == nearest && there > other) {
                    other = there;
                    nearest = solid;
                }
            }
        }
    }
    if own == 0u && other > 0u && textureLoad(layer, pixel, 0).a >= props[other - 1u].min_opacity {
        // A prop as trained covers the pixel. If it is solid there, the coverage pass knows what is in front of it.
        other = select(0u, other, is_solid(solid_here));
    }
    let kept = select(0u, own, smooths(own));
    let owners = vec2(kept, other);
    let may_have_slits = kept > 0u && props[max(kept, 1u) - 1u].smooths == SMOOTHS_SLITS;
    ends = ends || (may_have_slits && is_at_slit(layer, pixel));
    if !ends || all(owners == vec2(0u)) {
        return Edge(vec2(0u), inside);
    }
#ifdef ESTIMATES
    let around = opacity_around(layer, owner, pixel, owners);
    if around.is_known {
        if is_cut(around) {
            return Edge(owners, MASK_OF_ESTIMATES);
        }
        return Edge(vec2(0u), inside);
    }
#endif
    return Edge(owners, MASK_OF_RAYS);
}
