// The compare pass: finds out whether the scene that the props are drawn into has changed since the last frame, and
// copies it for the next one.

#import bevy_plenoctree::view::View

// The flags that `view.wgsl` declares.
struct Stale {
    layer: atomic<u32>,
    composite: atomic<u32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read_write> stale: Stale;
// The bits of what was seen in the last frame.
@group(0) @binding(2) var before: texture_2d<u32>;
#ifdef COLORS
@group(0) @binding(3) var scene: texture_2d<f32>;
#else ifdef MULTISAMPLED
@group(0) @binding(3) var scene: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene: texture_depth_2d;
#endif

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4(vec2(f32((index << 1u) & 2u), f32(index & 2u)) * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec2<u32> {
    let pixel = vec2<u32>(position.xy);
#ifdef COLORS
    // The composite is stored as half floats too.
    let color = textureLoad(scene, pixel + view.corner, 0);
    let seen = vec2(pack2x16float(color.rg), pack2x16float(vec2(color.b, 0.0)));
#else
    var seen = vec2(bitcast<u32>(textureLoad(scene, pixel + view.corner, 0)), 0u);
#ifdef MULTISAMPLED
    // Smooth edges depend on all samples. A change of one always changes this word, and one of several nearly always.
    for (var s = 1u; s < textureNumSamples(scene); s++) {
        seen.x = (seen.x * 0x9e3779b1u) ^ bitcast<u32>(textureLoad(scene, pixel + view.corner, s));
    }
#endif
#endif
    if any(textureLoad(before, pixel, 0).xy != seen) {
#ifdef COLORS
        atomicStore(&stale.composite, 1u);
#else
        atomicStore(&stale.layer, 1u);
#endif
    }
    return seen;
}
