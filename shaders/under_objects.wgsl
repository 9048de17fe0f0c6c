// Writes what transparent objects are blended over: the light of props alone.

#import bevy_plenoctree::front::front_at
#import bevy_plenoctree::target::to_target
#import bevy_plenoctree::view::{is_drawn, view}

// The target, with the props. It has the size of what is written.
@group(2) @binding(0) var scene: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<u32>(position.xy);
    let pixel = at - view.corner;
    if !is_drawn(pixel) {
        discard;
    }
    return vec4(to_target(front_at(pixel).own), textureLoad(scene, at, 0).a);
}
