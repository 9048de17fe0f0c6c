// The compare pass: finds out whether the scene that the props are drawn into has changed since the last frame, and copies
// it for the next one. It has one invocation per pixel.

#import bevy_plenoctree::view::View

// The flags that `view.wgsl` declares.
struct Stale {
    layer: atomic<u32>,
    composite: atomic<u32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read_write> stale: Stale;
// What was seen in the last frame. One depth per pixel of the viewport, or the three channels of its color.
@group(0) @binding(2) var<storage, read_write> copies: array<f32>;
#ifdef COLORS
@group(0) @binding(3) var scene: texture_2d<f32>;
#else ifdef MULTISAMPLED
@group(0) @binding(3) var scene: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene: texture_depth_2d;
#endif

@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = view.low + id.xy;
    if any(pixel >= view.high) {
        return;
    }
    let index = pixel.y * view.size.x + pixel.x;
    let seen = textureLoad(scene, pixel + view.corner, 0);
#ifdef COLORS
    let before = vec3(copies[3u * index], copies[3u * index + 1u], copies[3u * index + 2u]);
    if any(seen.rgb != before) {
        copies[3u * index] = seen.r;
        copies[3u * index + 1u] = seen.g;
        copies[3u * index + 2u] = seen.b;
        atomicStore(&stale.composite, 1u);
    }
    // The composite shows the layer.
    if id.x + id.y == 0u && atomicLoad(&stale.layer) != 0u {
        atomicStore(&stale.composite, 1u);
    }
#else
    if seen != copies[index] {
        copies[index] = seen;
        atomicStore(&stale.layer, 1u);
    }
#endif
}
