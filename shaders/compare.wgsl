// Finds out whether the scene that the props are drawn into, or the light on the props, has changed since the last frame,
// and remembers it for the next one.

#import bevy_plenoctree::view::View

@group(0) @binding(0) var<uniform> view: View;
// The number that `view.wgsl` declares.
@group(0) @binding(1) var<storage, read_write> first_drawn: atomic<u32>;
// What was seen in the last frame: a word for the depth of each pixel, then one for the color of each, and one for the
// light on each.
@group(0) @binding(2) var<storage, read_write> before: array<u32>;
#ifdef DEPTH
@group(0) @binding(3) var scene: texture_depth_2d;
#else ifdef MULTISAMPLED
@group(0) @binding(3) var scene: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene: texture_2d<f32>;
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
    let word = (#{RESULT}u * view.size.y + pixel.y) * view.size.x + pixel.x;
#ifdef LIGHT
    let at = pixel;
#else
    let at = pixel + view.corner;
#endif
#ifdef DEPTH
    let seen = bitcast<u32>(textureLoad(scene, at, 0));
#else ifdef MULTISAMPLED
    // Smooth edges depend on all samples.
    var seen = bitcast<u32>(textureLoad(scene, at, 0));
    for (var s = 1u; s < textureNumSamples(scene); s++) {
        seen = mixed(seen, bitcast<u32>(textureLoad(scene, at, s)));
    }
#else
    // The composite and the light are stored as half floats, too.
    let color = textureLoad(scene, at, 0);
    let seen = mixed(pack2x16float(color.rg), pack2x16float(color.ba));
#endif
    if before[word] != seen {
        before[word] = seen;
        atomicMin(&first_drawn, #{RESULT}u);
    }
}
