//! Measures how far posterized pictures are from their originals.

use glam::DVec3;
use image::{RgbImage, RgbaImage};
use plenoctree::{LABEL_OPACITY, palette::ColorErrors};
use plenoctree_cli::hex;

/// Compares a posterized picture with its original, weighted by opacity, where it is posterized. Returns `None` if it
/// is posterized nowhere.
pub fn of_picture(original: &RgbaImage, shown: &RgbImage) -> Option<ColorErrors> {
    let pixels = original.pixels().zip(shown.pixels()).filter_map(|(original, shown)| {
        let [r, g, b, opacity] = hex::unit(original.0);
        (opacity >= LABEL_OPACITY).then(|| (opacity, DVec3::new(r, g, b), DVec3::from_array(hex::unit(shown.0))))
    });
    let mut pixels = pixels.peekable();
    pixels.peek()?;
    Some(ColorErrors::of(pixels))
}

/// Returns the peak signal-to-noise ratio in dB, infinite without differences.
pub fn psnr_db(errors: ColorErrors) -> f64 {
    -20.0 * errors.rmse.log10()
}

/// Returns the errors of several pictures together, each with the same weight, or `None` if there is none.
pub fn mean(all: impl Iterator<Item = Option<ColorErrors>>) -> Option<ColorErrors> {
    let all: Vec<ColorErrors> = all.flatten().collect();
    let mean = |of: fn(&ColorErrors) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
    (!all.is_empty())
        .then(|| ColorErrors { rmse: mean(|errors| errors.rmse * errors.rmse).sqrt(), hue: mean(|errors| errors.hue) })
}

#[cfg(test)]
mod tests {
    use image::{Rgb, Rgba};

    use super::*;

    /// Only posterized pixels count, weighted by opacity.
    #[test]
    fn the_background_does_not_count() {
        let mut original = RgbaImage::from_pixel(3, 1, Rgba([255, 255, 255, 0]));
        let mut shown = RgbImage::from_pixel(3, 1, Rgb([0, 0, 0]));
        assert_eq!(of_picture(&original, &shown), None);
        original.put_pixel(1, 0, Rgba([255, 0, 0, 255]));
        shown.put_pixel(1, 0, Rgb([255, 0, 0]));
        original.put_pixel(2, 0, Rgba([0, 0, 255, 85]));
        shown.put_pixel(2, 0, Rgb([255, 0, 0]));
        let errors = of_picture(&original, &shown).unwrap();
        assert!((errors.hue - 0.25).abs() < 1e-9 && (errors.rmse - (2.0f64 / 12.0).sqrt()).abs() < 1e-9, "{errors:?}");
        assert!((psnr_db(errors) - 10.0 * 6f64.log10()).abs() < 1e-9);
    }
}
