//! Image sizes on the command line.

/// Parses `WxH`, in pixels.
pub fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|pixels| (1..=16384).contains(pixels));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| "expected WxH, each from 1 to 16384".into())
}

#[cfg(test)]
mod tests {
    use super::parse_size;

    #[test]
    fn sizes_are_checked() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)));
        assert_eq!(parse_size("1X16384"), Ok((1, 16384)));
        for wrong in ["", "640", "0x1", "1x16385", "-1x1", "1x1x1"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
