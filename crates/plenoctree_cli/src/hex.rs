//! Colors as hex codes and in 8 bits.

/// Parses `#RRGGBB`, with or without the `#`.
pub fn parse(text: &str) -> Result<[u8; 3], String> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    if digits.len() != 6 || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return Err("expected #RRGGBB".into());
    }
    let value = u32::from_str_radix(digits, 16).map_err(|error| error.to_string())?;
    Ok([(value >> 16) as u8, (value >> 8) as u8, value as u8])
}

/// Formats a color as `#rrggbb`.
pub fn format([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Rounds encoded sRGB to 8 bits, clamped to the range of a screen.
pub fn quantize(color: [f64; 3]) -> [u8; 3] {
    color.map(|channel| (255.0 * channel.clamp(0.0, 1.0)).round() as u8)
}

/// Returns channels of 8 bits as numbers from 0 to 1.
pub fn unit<const CHANNELS: usize>(color: [u8; CHANNELS]) -> [f64; CHANNELS] {
    color.map(|channel| f64::from(channel) / 255.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_parsed_and_formatted() {
        assert_eq!(parse("#2060ff"), Ok([0x20, 0x60, 0xff]));
        assert_eq!(parse("2060FF").map(format).as_deref(), Ok("#2060ff"));
        for wrong in ["", "#", "#fff", "#2060fg", "#+060ff", "#2060ff0"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn neon_colors_are_clamped() {
        assert_eq!(quantize([-0.5, 0.5, 1.5]), [0, 128, 255]);
    }

    #[test]
    fn bytes_come_back() {
        assert_eq!(unit([0, 51, 255]), [0.0, 0.2, 1.0]);
        assert!((0..=255).all(|byte| quantize(unit([byte; 3])) == [byte; 3]));
    }
}
