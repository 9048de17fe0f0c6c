//! Posterization: section 4 of the method.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::render::Rendering;
use crate::{
    field::LABEL_OPACITY,
    palette::{LabelSpace, Palette},
    srgb::decode,
};

/// Settings of posterization, with the values of section 4 of the method as defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posterization {
    /// `d`: number of steps from one palette color to another. With 1, there are no blends. 3 by default.
    pub blend_steps: u32,
    /// The space in which pixels are compared to labels. Encoded sRGB by default.
    pub space: LabelSpace,
    /// `D`: width over which labels blend, in that space. 0 is a hard edge. 0.2 by default.
    pub softness: f64,
    /// `lambda`: opacity below which a pixel is shown as rendered, as are pixels in which nothing is. 80/255 by default.
    pub min_opacity: f64,
    /// Number of runs of the bilateral filter, each horizontal and then vertical. 4 by default.
    pub iterations: u32,
    /// Radius of the filter in pixels. 2 by default.
    pub radius: u32,
    /// Number of pixels that the filter reads on each side, spread over the radius. All of them by default.
    pub taps: u32,
    /// Spatial sigma of the filter in pixels. 3 by default.
    pub spatial_sigma: f64,
    /// Range sigma of the filter in CIELAB. 4.25 by default.
    pub range_sigma: f64,
}

impl Default for Posterization {
    fn default() -> Self {
        Self {
            blend_steps: 3,
            space: LabelSpace::Encoded,
            softness: 0.2,
            min_opacity: LABEL_OPACITY,
            iterations: 4,
            radius: 2,
            taps: u32::MAX,
            spatial_sigma: 3.0,
            range_sigma: 4.25,
        }
    }
}

/// Returns the labels of a palette: its colors, then the blends of every pair. Equation 7 of the paper.
///
/// Colors are encoded sRGB. From source colors, these are the source colors of the labels, and from shown colors, their
/// shown colors.
pub fn labels(palette: &[DVec3], blend_steps: u32) -> Vec<DVec3> {
    let mut labels = palette.to_vec();
    for (i, first) in palette.iter().enumerate() {
        for second in &palette[i + 1..] {
            for k in 1..blend_steps {
                let share = f64::from(k) / f64::from(blend_steps);
                labels.push(share * first + (1.0 - share) * second);
            }
        }
    }
    labels
}

/// The part of the softness over which tones of two ramps blend.
const ACROSS_RAMPS: f64 = 0.25;
/// The opacity from which pixels that show tones are opaque.
const OPAQUE: f64 = 0.9;

/// Returns how opaque labels in this space are shown where the field has an `opacity`, from 0 to 1: tones over what is
/// behind them, so that haze and glass stay what they are. Others are always opaque. See section 4 of the method.
#[must_use]
pub fn shown_opacity(space: LabelSpace, opacity: f64) -> f64 {
    match space {
        LabelSpace::Tones => (opacity / OPAQUE).min(1.0),
        LabelSpace::Encoded => 1.0,
    }
}

/// Posterizes a rendering over `background`: filters it, and replaces every pixel with the shown colors of its nearest
/// labels. Thin pixels are shown as rendered. In tone space, others are shown over the background, too, unless they are
/// nearly opaque.
///
/// `shown` are the shown colors of the palette, in its order. Colors are encoded sRGB. The result has the pixel order of
/// [`Rendering`].
pub fn posterize(
    rendering: &Rendering,
    background: DVec3,
    palette: &Palette,
    shown: &[DVec3],
    settings: &Posterization,
) -> Vec<DVec3> {
    let filtered = filter(rendering, background, settings);
    let place = |color| settings.space.place(color);
    let source: Vec<DVec3> = palette.colors.iter().map(|&color| color.into()).collect();
    let places = labels(&source, settings.blend_steps).into_iter().map(place);
    // Blends are in no ramp.
    let ramp = |label| match settings.space {
        LabelSpace::Encoded => None,
        LabelSpace::Tones => palette.ramp_of(label),
    };
    let shown = labels(shown, settings.blend_steps);
    let labels: Vec<Label> = places
        .zip(shown)
        .enumerate()
        .map(|(label, (place, shown))| Label { place, shown, ramp: ramp(label) })
        .collect();
    filtered
        .iter()
        .zip(&rendering.opacity)
        .map(|(&color, &opacity)| {
            if is_thin(opacity, settings) {
                return color;
            }
            let label = assign(place(color), &labels, settings.softness);
            background.lerp(label, shown_opacity(settings.space, opacity))
        })
        .collect()
}

/// Returns whether a pixel with this opacity is shown as rendered.
fn is_thin(opacity: f64, settings: &Posterization) -> bool {
    opacity < settings.min_opacity.max(f64::from(f32::EPSILON))
}

/// Flattens the colors of a rendering over `background` with the bilateral filter: section 4 of the method, step 2. Thin
/// pixels are left as rendered. In tone space, the others have the colors of the field alone, without the background.
pub fn filter(rendering: &Rendering, background: DVec3, settings: &Posterization) -> Vec<DVec3> {
    let thin: Vec<bool> = rendering.opacity.iter().map(|&opacity| is_thin(opacity, settings)).collect();
    let mut image = rendering.over(background);
    if settings.space == LabelSpace::Tones {
        for (pixel, shown) in image.iter_mut().enumerate().filter(|(pixel, _)| !thin[*pixel]) {
            *shown = rendering.color[pixel] / rendering.opacity[pixel].max(f64::MIN_POSITIVE);
        }
    }
    bilateral(&image, &thin, rendering.width.max(1), settings)
}

/// A label: where colors are compared with it, what it shows, and its ramp.
#[derive(Clone, Copy, Default)]
struct Label {
    place: DVec3,
    shown: DVec3,
    ramp: Option<usize>,
}

/// Blends the two nearest labels: steps 3 and 4. `place` is in the space of the labels.
fn assign(place: DVec3, labels: &[Label], softness: f64) -> DVec3 {
    let (mut nearest, mut second) = ((f64::INFINITY, Label::default()), (f64::INFINITY, Label::default()));
    for &label in labels {
        let distance = place.distance(label.place);
        if distance < nearest.0 {
            second = nearest;
            nearest = (distance, label);
        } else if distance < second.0 {
            second = (distance, label);
        }
    }
    let is_across = nearest.1.ramp.zip(second.1.ramp).is_some_and(|(first, second)| first != second);
    let softness = if is_across { ACROSS_RAMPS * softness } else { softness };
    if softness == 0.0 || !second.0.is_finite() {
        return nearest.1.shown;
    }
    let step = (0.5 + (second.0 - nearest.0) / (2.0 * softness)).clamp(0.5, 1.0);
    let share = step * step * (3.0 - 2.0 * step);
    share * nearest.1.shown + (1.0 - share) * second.1.shown
}

/// Applies the separable bilateral filter: step 2. Pixels marked `thin` are not changed. They are read, unless labels are
/// tones.
fn bilateral(image: &[DVec3], thin: &[bool], width: usize, settings: &Posterization) -> Vec<DVec3> {
    let mut image = image.to_vec();
    for _ in 0..settings.iterations {
        for along_rows in [true, false] {
            image = pass(&image, thin, width, along_rows, settings);
        }
    }
    image
}

fn pass(image: &[DVec3], thin: &[bool], width: usize, along_rows: bool, settings: &Posterization) -> Vec<DVec3> {
    let lab: Vec<DVec3> = image.par_iter().map(|&color| cielab(color)).collect();
    let height = image.len() / width;
    let radius = settings.radius as isize;
    let taps = settings.taps.clamp(1, settings.radius.max(1)) as isize;
    let offset = |tap: isize| tap.signum() * (2 * tap.abs() * radius + taps) / (2 * taps);
    let gauss = |squared: f64, sigma: f64| (-squared / (2.0 * sigma * sigma)).exp();
    (0..image.len())
        .into_par_iter()
        .map(|pixel| {
            if thin[pixel] {
                return image[pixel];
            }
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            let (mut sum, mut total) = (DVec3::ZERO, 0.0);
            for offset in (-taps..=taps).map(offset) {
                let (x, y) = if along_rows { (x + offset, y) } else { (x, y + offset) };
                if x < 0 || y < 0 || x >= width as isize || y >= height as isize {
                    continue;
                }
                let tap = y as usize * width + x as usize;
                if thin[tap] && settings.space == LabelSpace::Tones {
                    continue;
                }
                let weight = gauss((offset * offset) as f64, settings.spatial_sigma)
                    * gauss(lab[tap].distance_squared(lab[pixel]), settings.range_sigma);
                sum += weight * image[tap];
                total += weight;
            }
            sum / total
        })
        .collect()
}

/// Converts encoded sRGB to CIELAB under D65.
pub fn cielab(encoded: DVec3) -> DVec3 {
    let linear = DVec3::from_array(encoded.to_array().map(decode));
    let xyz_from_rgb = DMat3::from_cols_array(&[
        0.4124, 0.2126, 0.0193, //
        0.3576, 0.7152, 0.1192, //
        0.1805, 0.0722, 0.9505,
    ]);
    let white = xyz_from_rgb * DVec3::ONE;
    let f = (xyz_from_rgb * linear / white).to_array().map(|t: f64| {
        let edge = 6.0 / 29.0;
        if t > edge * edge * edge { t.cbrt() } else { t / (3.0 * edge * edge) + 4.0 / 29.0 }
    });
    DVec3::new(116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where nothing is, nothing is posterized, even if any opacity is enough. With tones, labels do not depend on it.
    #[test]
    fn empty_pixels_show_the_background() {
        let rendering =
            Rendering { width: 2, height: 1, color: vec![DVec3::splat(0.505), DVec3::ZERO], opacity: vec![1.0, 0.0] };
        let palette = Palette::new(vec![[0.45; 3], [0.55; 3]]).unwrap();
        let shown = [DVec3::X, DVec3::Y];
        for space in [LabelSpace::Encoded, LabelSpace::Tones] {
            let settings =
                Posterization { min_opacity: 0.0, softness: 0.0, blend_steps: 1, space, ..Default::default() };
            let background = DVec3::splat(0.45);
            let pixels = posterize(&rendering, background, &palette, &shown, &settings);
            assert_eq!(pixels[1], background, "{space:?}");
            if space == LabelSpace::Tones {
                assert_eq!(pixels[0], DVec3::Y);
            }
        }
    }
}
