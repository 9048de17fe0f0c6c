// Finds out whether the scene that the props are drawn into, or the light on the props, has changed since the last frame,
// and remembers it for the next one.

#import bevy_plenoctree::view::View

// The flags that `view.wgsl` declares.
struct Stale {
    layer: atomic<u32>,
    composite: atomic<u32>,
    labels: atomic<u32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read_write> stale: Stale;
// What was seen in the last frame: a word for the depth of each pixel, then one for the color of each, and one for the
// light on each.
@group(0) @binding(2) var<storage, read_write> before: array<u32>;
#ifdef COLORS
@group(0) @binding(3) var scene: texture_2d<f32>;
#else ifdef MULTISAMPLED
@group(0) @binding(3) var scene: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene: texture_depth_2d;
#endif

// Mixes two words into one. A change of one always changes the result, and a change of both nearly always.
fn mixed(a: u32, b: u32) -> u32 {
    return (a * 0x9e3779b1u) ^ b;
}

@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = id.xy;
    if any(pixel >= view.size) {
        return;
    }
    var word = pixel.y * view.size.x + pixel.x;
#ifdef COLORS
#ifdef LIGHT
    let color = textureLoad(scene, pixel, 0);
    word += 2u * view.size.x * view.size.y;
#else
    let color = textureLoad(scene, pixel + view.corner, 0);
    word += view.size.x * view.size.y;
#endif
    // The composite and the light are stored as half floats, too.
    let seen = mixed(pack2x16float(color.rg), pack2x16float(color.ba));
#else
    var seen = bitcast<u32>(textureLoad(scene, pixel + view.corner, 0));
#ifdef MULTISAMPLED
    // Smooth edges depend on all samples.
    for (var s = 1u; s < textureNumSamples(scene); s++) {
        seen = mixed(seen, bitcast<u32>(textureLoad(scene, pixel + view.corner, s)));
    }
#endif
#endif
    if before[word] != seen {
        before[word] = seen;
#ifdef LIGHT
        atomicStore(&stale.labels, 1u);
#else ifdef COLORS
        atomicStore(&stale.composite, 1u);
#else
        atomicStore(&stale.layer, 1u);
#endif
    }
}
