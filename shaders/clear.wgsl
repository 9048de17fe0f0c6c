// Clears the attachments of a pass whose result may be kept.

struct Fragment {
#ifdef SOLID
    @location(0) solid: u32,
#else
    @location(0) color: vec4<f32>,
    @location(1) owner: vec4<f32>,
#ifdef MOTION
    @location(2) motion: vec4<f32>,
#endif
#endif
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment() -> Fragment {
    return Fragment();
}
