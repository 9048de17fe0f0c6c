//! Weighted colors in a space that separates luma from chroma.

use glam::{DVec2, DVec3, swizzles::Vec3Swizzles};

use crate::palette::oklab::{CHROMATIC, chroma};

/// How much the relative error of chroma counts.
const CHROMA: f64 = 0.06;

/// Share of the weight below which a point is left out.
const NEGLIGIBLE: f64 = 1e-12;

/// Weighted colors in opponent space.
pub(super) struct Points {
    pub all: Vec<Point>,
    /// a and b in Oklab of every point, and its share of the visible weight.
    pub chroma: Vec<(DVec2, f32)>,
}

/// A weighted color.
#[derive(Clone, Copy)]
pub(super) struct Point {
    /// The color in opponent space.
    pub color: [f32; 3],
    /// Weight of an error of luma: the point's share of the weight.
    pub weight: f32,
    /// Weight of an error of chroma, which is larger.
    pub chroma_weight: f32,
}

impl Points {
    /// Merges the colors (encoded sRGB) in every cell of a lattice of `lattice` cells per channel into their mean.
    ///
    /// `weights` are their visible weights, and `salient` those that the fit uses.
    pub fn new(colors: &[[f64; 3]], weights: &[f64], salient: &[f64], lattice: usize) -> Self {
        let mut cells = vec![(DVec3::ZERO, 0.0, 0.0); lattice.pow(3)];
        for ((color, weight), salient) in colors.iter().zip(weights).zip(salient) {
            let [r, g, b] = color.map(|c| ((c * lattice as f64) as usize).min(lattice - 1));
            let (sum, total, seen) = &mut cells[(r * lattice + g) * lattice + b];
            *sum += *salient * DVec3::from(*color);
            *total += salient;
            *seen += weight;
        }
        let cells = cells.into_iter().filter(|(_, total, _)| *total > NEGLIGIBLE);
        let point = |(sum, total, seen): (DVec3, f64, f64)| {
            let (point, chroma) = Point::new(sum / total, total);
            (point, (chroma, seen as f32))
        };
        let (all, chroma) = cells.map(point).unzip();
        Self { all, chroma }
    }

    /// Returns the variance of the colors, summed over the channels.
    pub fn variance(&self) -> f64 {
        variance(self.all.iter().map(|point| (point.position(), f64::from(point.weight))))
    }
}

/// Returns the variance of weighted colors, summed over the channels.
pub(super) fn variance(colors: impl Iterator<Item = (DVec3, f64)>) -> f64 {
    let (mut total, mut sum, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for (color, weight) in colors {
        total += weight;
        sum += weight * color;
        squares += weight * (color * color);
    }
    let mean = sum / total;
    (squares / total - mean * mean).element_sum().max(0.0)
}

impl Point {
    /// Returns the point of a color (encoded sRGB), and a and b in Oklab.
    ///
    /// Errors of chroma are relative to the color's own chroma: a hue is off if the error is as large as the chroma
    /// itself. The ratio of chroma in Oklab and in opponent space, which depends on hue and luma, converts one to the
    /// other.
    fn new(color: DVec3, weight: f64) -> (Self, DVec2) {
        let plane = |color: DVec3| to_opponent(color).yz().length_squared();
        let seen = chroma(color);
        let ratio = |color: DVec3, seen: DVec2| seen.length_squared() / plane(color);
        // Grays have no ratio; take that of a tint.
        let tint = color + DVec3::new(TINT, 0.0, -TINT);
        let ratio = if plane(color) > TINT * TINT { ratio(color, seen) } else { ratio(tint, chroma(tint)) };
        let hued = seen.length_squared();
        let chroma_weight = 1.0 + CHROMA * ratio * hued / (hued + CHROMATIC * CHROMATIC).powi(2);
        let point = Self {
            color: to_opponent(color).as_vec3().into(),
            weight: weight as f32,
            chroma_weight: (weight * chroma_weight) as f32,
        };
        (point, seen)
    }

    /// Returns the color in opponent space.
    pub fn position(&self) -> DVec3 {
        glam::Vec3::from(self.color).as_dvec3()
    }
}

/// A change of red and blue that is just more than rounding.
const TINT: f64 = 3e-3;

/// Rotates encoded sRGB so that x is luma, and y and z are chroma. Distances stay the same.
pub(super) fn to_opponent(rgb: DVec3) -> DVec3 {
    DVec3::new(
        rgb.element_sum() / 3f64.sqrt(),
        (rgb.x - rgb.y) / 2f64.sqrt(),
        (rgb.x + rgb.y - 2.0 * rgb.z) / 6f64.sqrt(),
    )
}

/// Rotates opponent space back to encoded sRGB.
pub(super) fn to_rgb(opponent: DVec3) -> DVec3 {
    let [luma, u, v] = [opponent.x / 3f64.sqrt(), opponent.y / 2f64.sqrt(), opponent.z / 6f64.sqrt()];
    DVec3::new(luma + u + v, luma - u + v, luma - 2.0 * v)
}
