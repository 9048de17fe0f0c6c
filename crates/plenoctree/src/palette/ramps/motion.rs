//! How the tones of a ramp move together in Oklab: section 4 of the method, step 7.

use glam::{DVec2, DVec3, swizzles::Vec3Swizzles};

use crate::palette::{colors::Palette, oklab::oklab};

/// Lightness below which chroma is not proportional to lightness any more.
const DARK: f64 = 0.12;
/// Ratio of chroma to lightness below which a ramp is gray, and has no hue to turn.
const GRAY: f64 = 0.05;
/// The least weight of a tone: those of handmade palettes may be 0, or there are none.
const LEAST: f64 = 1e-9;

/// Where a ramp moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// The mean in Oklab.
    pub mean: DVec3,
    /// Factor of the differences of lightness from the mean.
    pub contrast: f64,
    /// Factor of the differences of chroma from the mean.
    pub spread: f64,
    /// How much the ratio of chroma to lightness grows with the source lightness: 0 unless shadows get another tint.
    pub tint: DVec2,
}

/// The tones of a ramp in Oklab.
pub(super) struct Shades<'a> {
    palette: &'a Palette,
    tones: &'a [usize],
}

impl<'a> Shades<'a> {
    /// Returns the tones of a ramp, or `None` if there is no such ramp, or if it does not fit the palette.
    pub fn of(palette: &'a Palette, ramp: usize) -> Option<Self> {
        let tones = &palette.ramps.get(ramp)?.tones;
        let (colors, weights) = (palette.colors.len(), palette.weights.len());
        let fits = tones.iter().all(|tone| *tone < colors && (weights == 0 || *tone < weights));
        (fits && !tones.is_empty()).then_some(Self { palette, tones })
    }

    pub fn tones(&self) -> impl Iterator<Item = usize> {
        self.tones.iter().copied()
    }

    /// Returns the index, the weight and the color of all tones.
    fn shades(&self) -> impl Iterator<Item = (usize, f64, DVec3)> {
        let weight = |tone: usize| self.palette.weights.get(tone).map_or(LEAST, |weight| weight.max(LEAST));
        self.tones().map(move |tone| (tone, weight(tone), oklab(self.palette.colors[tone].into())))
    }

    /// Returns the weighted mean.
    pub fn mean(&self) -> DVec3 {
        let (sum, weight) = self
            .shades()
            .fold((DVec3::ZERO, 0.0), |(sum, total), (_, weight, shade)| (sum + weight * shade, total + weight));
        sum / weight
    }

    /// Returns how far the lightness reaches below and above the mean.
    pub fn reach(&self) -> (f64, f64) {
        let mean = self.mean().x;
        let reach = |(below, above): (f64, f64), (_, _, shade): (usize, f64, DVec3)| {
            (below.max(mean - shade.x), above.max(shade.x - mean))
        };
        self.shades().fold((0.0, 0.0), reach)
    }

    /// Calls `place` with every tone and its color in Oklab after a motion. The mean of these colors is that of the
    /// motion, and a motion to the ramp's own mean changes nothing.
    pub fn place(&self, motion: &Motion, mut place: impl FnMut(usize, DVec3)) {
        let mean = self.mean().x;
        let lightness = |shade: DVec3| motion.mean.x + motion.contrast * (shade.x - mean);
        // Chroma is proportional to lightness, as when there is more or less light.
        let ratio = |shade: DVec3| shade.yz() / shade.x.max(DARK);
        let (mut sum, mut light, mut scales, mut total) = (DVec2::ZERO, 0.0, 0.0, 0.0);
        for (_, weight, shade) in self.shades() {
            let scale = lightness(shade).max(DARK);
            sum += weight * scale * ratio(shade);
            light += weight * scale * shade.x;
            scales += weight * scale;
            total += weight;
        }
        let (own, middle, target) = (sum / scales, light / scales, motion.mean.yz() * (total / scales));
        // Turns and scales hues around their mean. Between grays, which have none, differences stay.
        let turn = DVec2::new(own.x, -own.y).rotate(target) + DVec2::new(GRAY * GRAY, 0.0);
        let turn = motion.spread * (turn / (own.length_squared() + GRAY * GRAY)).clamp_length_max(1.0);
        for (tone, _, shade) in self.shades() {
            let ratio = target + turn.rotate(ratio(shade) - own) + (shade.x - middle) * motion.tint;
            let chroma = lightness(shade).max(DARK) * ratio;
            place(tone, DVec3::new(lightness(shade), chroma.x, chroma.y));
        }
    }
}
