// Clears the attachments of a pass whose result may be cached.

struct Fragment {
#ifdef FLOAT_0
    @location(0) first: vec4<f32>,
#endif
#ifdef UINT_0
    @location(0) first: vec4<u32>,
#endif
#ifdef FLOAT_1
    @location(1) second: vec4<f32>,
#endif
#ifdef UINT_1
    @location(1) second: vec4<u32>,
#endif
#ifdef FLOAT_2
    @location(2) third: vec4<f32>,
#endif
#ifdef DEPTH
    @builtin(frag_depth) depth: f32,
#endif
}

@fragment
fn fragment() -> Fragment {
    var cleared = Fragment();
#ifdef NEGATIVE_ALPHA
    cleared.first.a = -1.0;
#endif
    return cleared;
}
