// Finds out whether the scene that the props are drawn into, or the light on the props, has changed since the last frame,
// and remembers it for the next one.

#import bevy_plenoctree::view::View

@group(0) @binding(0) var<uniform> view: View;
// The number that `view.wgsl` declares.
@group(0) @binding(1) var<storage, read_write> first_drawn: atomic<u32>;
// What was seen in the last frame: words for the depths of pixels, then words for their colors, and words for the light on
// them. ROWS pixels of a column share a word.
@group(0) @binding(2) var<storage, read_write> before: array<u32>;
#ifdef DEPTH
@group(0) @binding(3) var scene: texture_depth_2d;
#else ifdef MULTISAMPLED
@group(0) @binding(3) var scene: texture_depth_multisampled_2d;
#else
@group(0) @binding(3) var scene: texture_2d<f32>;
#endif

// The pixels of a column that share a word. Matches `cache.rs`.
const ROWS: u32 = 8u;

// Mixes two words into one. A change of one always changes the result, and a change of both nearly always. Products carry
// bits up only, and simple floats differ in high bits, so these are brought down first.
fn mixed(a: u32, b: u32) -> u32 {
    return ((a ^ (a >> 15u)) * 0x9e3779b1u) ^ b;
}

// Returns what is seen at a pixel, as a word.
fn seen_at(pixel: vec2<u32>) -> u32 {
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
    return seen;
}

@compute @workgroup_size(8, 8)
fn compare(@builtin(global_invocation_id) id: vec3<u32>) {
    let across = vec2(view.size.x, (view.size.y + ROWS - 1u) / ROWS);
    if any(id.xy >= across) {
        return;
    }
    let word = (#{RESULT}u * across.y + id.y) * across.x + id.x;
    let end = min(ROWS * id.y + ROWS, view.size.y);
    var seen = 0u;
    for (var y = ROWS * id.y; y < end; y++) {
        seen = mixed(seen, seen_at(vec2(id.x, y)));
    }
    if before[word] != seen {
        before[word] = seen;
        atomicMin(&first_drawn, #{RESULT}u);
    }
}
