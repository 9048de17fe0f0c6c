// The finish pass where borders are hard and there is no ink: copies what the label pass shows.

@group(1) @binding(0) var shown: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(shown, vec2<u32>(position.xy), 0);
}
