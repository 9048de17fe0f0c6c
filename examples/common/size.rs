//! Image sizes on the command line.

/// Parses `WxH`, in pixels.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|pixels| (1..=16384).contains(pixels));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| "expected WxH, each from 1 to 16384".into())
}
