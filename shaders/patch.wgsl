// The patch pass: copies the result of the blend pass back to the texture that it was made from.

@group(1) @binding(0) var blended: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(blended, vec2<u32>(position.xy), 0);
}
