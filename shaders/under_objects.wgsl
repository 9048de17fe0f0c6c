// Copies what transparent objects are blended over: the target, with the props.

// It has the size of what is written.
@group(1) @binding(0) var scene: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(scene, vec2<u32>(position.xy), 0);
}
