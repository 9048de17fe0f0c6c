//! Posterization at run time, section 4 of the method.

use glam::{DMat3, DVec3};

use super::render::Rendering;

/// The values of section 4, the paper's by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posterization {
    /// `d`: how many steps lead from one palette color to another. 1 makes labels of the palette colors alone.
    pub blend_steps: u32,
    /// `D`: distance over which labels blend, in encoded RGB; 0 is a hard edge.
    pub softness: f64,
    /// `lambda`: opacity under which a pixel is shown as rendered.
    pub min_opacity: f64,
    /// How often the bilateral filter runs, horizontally and then vertically each time.
    pub iterations: u32,
    /// Its radius in pixels.
    pub radius: u32,
    /// Its spatial sigma in pixels.
    pub spatial_sigma: f64,
    /// Its range sigma in CIELAB.
    pub range_sigma: f64,
}

impl Default for Posterization {
    fn default() -> Self {
        Self {
            blend_steps: 3,
            softness: 0.2,
            min_opacity: 80.0 / 255.0,
            iterations: 4,
            radius: 2,
            spatial_sigma: 3.0,
            range_sigma: 4.25,
        }
    }
}

/// Equation 7: the palette, then the blends of every pair. Call it with the extracted palette for the colors that
/// distances are measured to, with the edited one for the colors that are shown.
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

/// The posterized picture over `background`, in encoded sRGB: filtered, every pixel of the object replaced by its label.
/// `reference` and `shown` are the extracted and the edited palette, of the same length.
pub fn posterize(
    picture: &Rendering,
    background: DVec3,
    reference: &[DVec3],
    shown: &[DVec3],
    settings: &Posterization,
) -> Vec<DVec3> {
    let thin: Vec<bool> = picture.opacity.iter().map(|&a| a < settings.min_opacity).collect();
    let filtered = bilateral(&picture.over(background), &thin, picture.width.max(1), settings);
    let reference = labels(reference, settings.blend_steps);
    let shown = labels(shown, settings.blend_steps);
    filtered
        .iter()
        .zip(&thin)
        .map(|(&color, &thin)| if thin { color } else { assign(color, &reference, &shown, settings.softness) })
        .collect()
}

/// Steps 3 and 4: the two nearest labels, blended softly.
fn assign(color: DVec3, reference: &[DVec3], shown: &[DVec3], softness: f64) -> DVec3 {
    let (mut nearest, mut second) = ((f64::INFINITY, color), (f64::INFINITY, color));
    for (label, &shown) in reference.iter().zip(shown) {
        let distance = color.distance(*label);
        if distance < nearest.0 {
            second = nearest;
            nearest = (distance, shown);
        } else if distance < second.0 {
            second = (distance, shown);
        }
    }
    if softness == 0.0 || !second.0.is_finite() {
        return nearest.1;
    }
    let step = (0.5 + (second.0 - nearest.0) / (2.0 * softness)).clamp(0.5, 1.0);
    let share = step * step * (3.0 - 2.0 * step);
    share * nearest.1 + (1.0 - share) * second.1
}

/// Step 2: the separable bilateral filter. Pixels marked `thin` are read but stay as they are.
fn bilateral(picture: &[DVec3], thin: &[bool], width: usize, settings: &Posterization) -> Vec<DVec3> {
    let mut picture = picture.to_vec();
    for _ in 0..settings.iterations {
        for along_rows in [true, false] {
            picture = pass(&picture, thin, width, along_rows, settings);
        }
    }
    picture
}

fn pass(picture: &[DVec3], thin: &[bool], width: usize, along_rows: bool, settings: &Posterization) -> Vec<DVec3> {
    let lab: Vec<DVec3> = picture.iter().map(|&color| cielab(color)).collect();
    let height = picture.len() / width;
    let radius = settings.radius as isize;
    let gauss = |squared: f64, sigma: f64| (-squared / (2.0 * sigma * sigma)).exp();
    (0..picture.len())
        .map(|pixel| {
            if thin[pixel] {
                return picture[pixel];
            }
            let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
            let (mut sum, mut total) = (DVec3::ZERO, 0.0);
            for offset in -radius..=radius {
                let (x, y) = if along_rows { (x + offset, y) } else { (x, y + offset) };
                if x < 0 || y < 0 || x >= width as isize || y >= height as isize {
                    continue;
                }
                let tap = y as usize * width + x as usize;
                let weight = gauss((offset * offset) as f64, settings.spatial_sigma)
                    * gauss(lab[tap].distance_squared(lab[pixel]), settings.range_sigma);
                sum += weight * picture[tap];
                total += weight;
            }
            sum / total
        })
        .collect()
}

/// Encoded sRGB to CIELAB under D65.
fn cielab(encoded: DVec3) -> DVec3 {
    let linear = DVec3::from_array(
        encoded.to_array().map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }),
    );
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
