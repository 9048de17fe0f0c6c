//! Measures how a posterized picture looks, compared to its original.

use bevy::color::{Oklaba, Srgba};
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use plenoctree_cli::hex;

/// Chroma in Oklab below which a color is gray, and a change of chroma by which a gray becomes tinted.
const GRAY: f64 = 0.03;
/// Chroma above which pixels of the main hue count.
const VIVID: f64 = 0.08;
/// Chroma above which a recolored pixel has a hue.
const HUED: f64 = 0.04;
/// The largest angle of pixels of the main hue to it, in degrees.
const MAIN: f64 = 20.0;
/// The largest angle of recolored pixels to their new hue, in degrees.
const RECOLORED: f64 = 30.0;

/// How a posterized picture looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measures {
    /// Share of the pixels whose 3 x 3 neighborhood is one color, within one level.
    pub flat: f64,
    /// Share of the gray pixels that became tinted.
    pub tinted: f64,
    /// Root mean square error of a and b of Oklab together.
    pub chroma: f64,
    /// Root mean square distance in encoded sRGB.
    pub rmse: f64,
    /// Of the pixels of the main hue, the share that did not get the new one.
    pub leaks: f64,
}

impl Measures {
    /// Measures a picture where `mask` is true. `recolored` is the same with the hue of the first color as that of the
    /// second.
    pub fn of(original: &RgbImage, [posterized, recolored]: [&RgbImage; 2], mask: &[bool], hues: [Rgb<u8>; 2]) -> Self {
        let hues = hues.map(|color| hue(chroma(color)));
        let mut sum = Self::default();
        let (mut all, mut grays, mut main) = (0.0f64, 0.0f64, 0.0f64);
        for ((x, y, before), _) in original.enumerate_pixels().zip(mask).filter(|(_, inside)| **inside) {
            let after = *posterized.get_pixel(x, y);
            let [a, b, moved] = [*before, after, *recolored.get_pixel(x, y)].map(chroma);
            all += 1.0;
            sum.flat += share(is_flat(posterized, x, y));
            sum.rmse += encoded(*before).distance_squared(encoded(after));
            sum.chroma += a.distance_squared(b);
            if a.length() < GRAY {
                grays += 1.0;
                sum.tinted += share(a.distance(b) > GRAY);
            }
            if a.length() > VIVID && between(hue(a), hues[0]) < MAIN {
                main += 1.0;
                sum.leaks += share(moved.length() <= HUED || between(hue(moved), hues[1]) >= RECOLORED);
            }
        }
        let [all, grays, main] = [all, grays, main].map(|count| count.max(1.0));
        Self {
            flat: sum.flat / all,
            tinted: sum.tinted / grays,
            chroma: (sum.chroma / all).sqrt(),
            rmse: (sum.rmse / all).sqrt(),
            leaks: sum.leaks / main,
        }
    }

    /// Returns the means of several pictures.
    pub fn mean(all: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        Self {
            flat: mean(|one| one.flat),
            tinted: mean(|one| one.tinted),
            chroma: mean(|one| one.chroma),
            rmse: mean(|one| one.rmse),
            leaks: mean(|one| one.leaks),
        }
    }
}

/// Returns the angle between two hues, in degrees, at most 180.
pub fn between(a: f64, b: f64) -> f64 {
    ((a - b + 180.0).rem_euclid(360.0) - 180.0).abs()
}

/// Returns the hue in Oklab of a color, in degrees.
pub fn hue_of(color: Rgb<u8>) -> f64 {
    hue(chroma(color))
}

fn share(counts: bool) -> f64 {
    f64::from(u8::from(counts))
}

fn is_flat(picture: &RgbImage, x: u32, y: u32) -> bool {
    let around = |at: u32, length: u32| at.saturating_sub(1)..(at + 2).min(length);
    let (mut low, mut high) = ([u8::MAX; 3], [u8::MIN; 3]);
    for y in around(y, picture.height()) {
        for x in around(x, picture.width()) {
            for (channel, value) in picture.get_pixel(x, y).0.into_iter().enumerate() {
                low[channel] = low[channel].min(value);
                high[channel] = high[channel].max(value);
            }
        }
    }
    (0..3).all(|channel| high[channel] - low[channel] <= 1)
}

fn encoded(Rgb(pixel): Rgb<u8>) -> DVec3 {
    DVec3::from_array(hex::unit(pixel))
}

/// Returns a and b of Oklab of a color.
pub fn chroma(Rgb([r, g, b]): Rgb<u8>) -> DVec2 {
    let color = Oklaba::from(Srgba::rgb_u8(r, g, b));
    DVec2::new(color.a.into(), color.b.into())
}

fn hue(chroma: DVec2) -> f64 {
    chroma.y.atan2(chroma.x).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Rgb<u8> = Rgb([200, 30, 30]);
    const BLUE: Rgb<u8> = Rgb([32, 80, 208]);
    const GRAY: Rgb<u8> = Rgb([128; 3]);

    /// A picture of 8 x 8 pixels, its left half red and its right half gray.
    fn halves(left: Rgb<u8>, right: Rgb<u8>) -> RgbImage {
        RgbImage::from_fn(8, 8, |x, _| if x < 4 { left } else { right })
    }

    fn measure(posterized: &RgbImage, recolored: &RgbImage) -> Measures {
        Measures::of(&halves(RED, GRAY), [posterized, recolored], &[true; 64], [RED, BLUE])
    }

    /// Nothing is lost where nothing changes. The two columns at the border are not flat.
    #[test]
    fn a_perfect_look_has_no_errors() {
        let perfect = measure(&halves(RED, GRAY), &halves(BLUE, GRAY));
        assert_eq!(perfect, Measures { flat: 0.75, ..Measures::default() });
    }

    /// Every error shows in its own measure.
    #[test]
    fn errors_are_told_apart() {
        let tinted = measure(&halves(RED, Rgb([128, 150, 128])), &halves(BLUE, GRAY));
        assert!(tinted.tinted == 1.0 && tinted.chroma > 0.02 && tinted.leaks == 0.0, "{tinted:?}");
        let darker = measure(&halves(RED, Rgb([108; 3])), &halves(BLUE, GRAY));
        let expected = (0.5 * 3.0 * (20.0f64 / 255.0).powi(2)).sqrt();
        assert!((darker.rmse - expected).abs() < 1e-9 && darker.tinted == 0.0 && darker.chroma < 1e-4, "{darker:?}");
        let mut leaking = halves(BLUE, GRAY);
        (0..8).for_each(|y| leaking.put_pixel(0, y, RED));
        assert_eq!(measure(&halves(RED, GRAY), &leaking).leaks, 0.25);
        assert_eq!(between(-170.0, 170.0), 20.0);
    }

    #[test]
    fn the_background_does_not_count() {
        let original = halves(RED, GRAY);
        let mask: Vec<bool> = (0..64).map(|pixel| pixel % 8 < 4).collect();
        let wrong = halves(RED, BLUE);
        let found = Measures::of(&original, [&wrong, &halves(BLUE, RED)], &mask, [RED, BLUE]);
        assert!(found.rmse == 0.0 && found.leaks == 0.0 && Measures::mean(&[found, found]) == found, "{found:?}");
    }
}
