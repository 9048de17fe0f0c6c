//! Compares views of the field with photographs.

use glam::{DVec2, DVec3, Vec3};
use plenoctree::PlenOctree;
use rayon::prelude::*;

use super::{
    grid::Grid,
    input::{Picture, ViewCamera},
    train::{TrainView, backdrop::Backdrop, batch::render_ray},
};

/// A view of the field, next to the photograph. Pixels are stored row by row, in encoded sRGB.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Name of the picture.
    pub name: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The photograph, over the backdrop.
    pub photographed: Vec<[u8; 3]>,
    /// The field, over the backdrop.
    pub rendered: Vec<[u8; 3]>,
    /// Peak signal-to-noise ratio, in decibels.
    pub psnr: f64,
    /// Structural similarity, at most 1: the mean over all pixels and channels, in Gaussian windows of 11 x 11 pixels.
    pub ssim: f64,
    /// PSNR after the view's exposure is matched: each channel multiplied by the best factor.
    pub aligned_psnr: f64,
}

/// Renders the field, as it is written to files, with the reference's march in float64, and compares what is known.
/// The rest is black in both.
pub fn compare(
    field: &PlenOctree,
    backdrop: &Backdrop,
    name: &str,
    camera: &ViewCamera,
    picture: &Picture,
) -> Comparison {
    let (width, height) = (camera.width, camera.height);
    let (rendered, photographed): (Vec<DVec3>, Vec<DVec3>) = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            if !camera.knows(x, y) {
                return (DVec3::ZERO, DVec3::ZERO);
            }
            let direction = camera.direction(DVec2::new(x.into(), y.into()) + 0.5);
            let (seen, opacity) = field.render_ray(camera.position, direction);
            let behind = backdrop.color(direction, Vec3::ONE).as_dvec3();
            let [r, g, b, a] = picture.pixels[pixel as usize].map(|byte| f64::from(byte) / 255.0);
            (seen + (1.0 - opacity) * behind, DVec3::new(r, g, b) + (1.0 - a) * behind)
        })
        .unzip();
    let squared: f64 = rendered.iter().zip(&photographed).map(|(a, b)| a.distance_squared(*b)).sum();
    let known = |pixel: usize| camera.knows(pixel as u32 % width, pixel as u32 / width);
    let count = 3.0 * (0..rendered.len()).filter(|pixel| known(*pixel)).count().max(1) as f64;
    let gain: DVec3 = {
        let product: DVec3 = rendered.iter().zip(&photographed).map(|(a, b)| *a * *b).sum();
        let square: DVec3 = rendered.iter().map(|a| *a * *a).sum();
        product / square.max(DVec3::splat(1e-9))
    };
    let aligned: f64 = rendered.iter().zip(&photographed).map(|(a, b)| (gain * *a).distance_squared(*b)).sum();
    let bytes = |colors: &[DVec3]| {
        colors.iter().map(|color| color.to_array().map(|x| (255.0 * x.clamp(0.0, 1.0)).round() as u8)).collect()
    };
    Comparison {
        name: name.into(),
        width,
        height,
        photographed: bytes(&photographed),
        rendered: bytes(&rendered),
        psnr: decibels(squared / count),
        ssim: ssim_where(&rendered, &photographed, width as usize, known),
        aligned_psnr: decibels(aligned / count),
    }
}

/// Returns the mean PSNR of the views, from some of their pixels, to report progress.
pub fn quick_psnr(grid: &Grid, backdrop: &Backdrop, views: &[TrainView]) -> Option<f64> {
    const STRIDE: u32 = 6;
    const MOST: usize = 16;
    let every = views.len().div_ceil(MOST).max(1);
    let of_view = |view: &TrainView| {
        let camera = &view.camera;
        let (mut squared, mut count) = (0.0, 0.0);
        for y in (STRIDE / 2..camera.height).step_by(STRIDE as usize) {
            for x in (STRIDE / 2..camera.width).step_by(STRIDE as usize).filter(|x| camera.knows(*x, y)) {
                let direction = camera.direction(DVec2::new(x.into(), y.into()) + 0.5);
                let behind = backdrop.color(direction, Vec3::ONE);
                let (seen, transmittance) = render_ray(grid, camera.position, direction);
                let [r, g, b, a] = view.picture.pixel(x, y);
                let error = seen + transmittance * behind - Vec3::new(r, g, b) - (1.0 - a) * behind;
                squared += f64::from(error.length_squared());
                count += 3.0;
            }
        }
        decibels(squared / f64::max(count, 1.0))
    };
    let values: Vec<f64> = views.par_iter().step_by(every).map(of_view).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Converts a mean squared error.
pub fn decibels(mean_squared: f64) -> f64 {
    -10.0 * mean_squared.max(1e-10).log10()
}

/// Returns the structural similarity of two images whose rows are `width` pixels wide, at most 1: the mean over all
/// pixels and channels, in Gaussian windows of 11 x 11 pixels with a standard deviation of 1.5 (Wang et al. 2004).
/// Colors are in encoded sRGB.
///
/// # Panics
///
/// Panics if the images do not consist of whole rows.
pub fn ssim(a: &[DVec3], b: &[DVec3], width: usize) -> f64 {
    ssim_where(a, b, width, |_| true)
}

/// Returns the mean over some of the pixels.
fn ssim_where(a: &[DVec3], b: &[DVec3], width: usize, counts: impl Fn(usize) -> bool) -> f64 {
    let (c1, c2) = (0.01f64.powi(2), 0.03f64.powi(2));
    let blurred = |f: &dyn Fn(DVec3, DVec3) -> DVec3| blur(a.iter().zip(b).map(|(a, b)| f(*a, *b)).collect(), width);
    let (mean_a, mean_b) = (blurred(&|a, _| a), blurred(&|_, b| b));
    let (aa, bb, ab) = (blurred(&|a, _| a * a), blurred(&|_, b| b * b), blurred(&|a, b| a * b));
    let pixels: Vec<usize> = (0..a.len()).filter(|pixel| counts(*pixel)).collect();
    let sum: DVec3 = (pixels.iter())
        .map(|&i| {
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, cov) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
            (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
        })
        .sum();
    sum.element_sum() / (3.0 * pixels.len().max(1) as f64)
}

/// Blurs an image with a Gaussian window of 11 x 11 pixels. At the edges, the window is cut off.
fn blur(image: Vec<DVec3>, width: usize) -> Vec<DVec3> {
    let weights: [f64; 11] = std::array::from_fn(|i| (-(i as f64 - 5.0).powi(2) / (2.0 * 1.5 * 1.5)).exp());
    let height = image.len() / width;
    let pass = |source: &[DVec3], length: usize, stride: usize, place: &(dyn Fn(usize) -> usize + Sync)| {
        (0..source.len())
            .into_par_iter()
            .map(|index| {
                let at = place(index);
                let (mut sum, mut total) = (DVec3::ZERO, 0.0);
                for (tap, weight) in weights.iter().enumerate() {
                    if let Some(other) = (at + tap).checked_sub(5).filter(|other| *other < length) {
                        sum += *weight * source[index + other * stride - at * stride];
                        total += weight;
                    }
                }
                sum / total
            })
            .collect::<Vec<_>>()
    };
    let rows = pass(&image, width, 1, &|index| index % width);
    pass(&rows, height, width, &|index| index / width)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What does not count does not help either.
    #[test]
    fn similarity_is_that_of_the_pixels_that_count() {
        let image = |seed: u64| -> Vec<DVec3> {
            let mut random = plenoctree::random::Random::new(seed);
            (0..64 * 64).map(|at| if at % 64 < 32 { DVec3::ZERO } else { DVec3::splat(random.unit().into()) }).collect()
        };
        let (a, b) = (image(1), image(2));
        let all = ssim(&a, &b, 64);
        // Away from the border between both halves.
        let noise = ssim_where(&a, &b, 64, |at| at % 64 >= 40);
        assert!(all > 0.4 && noise < 0.1, "{all} {noise}");
    }

    /// An image is identical to itself, hardly similar to noise, and less similar to a copy the more that is shifted.
    #[test]
    fn similarity_falls_with_differences() {
        let width = 48;
        let image = |shift: f64| -> Vec<DVec3> {
            (0..width * 40)
                .map(|i| {
                    DVec3::splat(
                        0.5 + 0.4 * (((i % width) as f64 + shift) / 3.0).sin() * ((i / width) as f64 / 4.0).cos(),
                    )
                })
                .collect()
        };
        let like = |shift: f64| ssim(&image(0.0), &image(shift), width);
        assert!((like(0.0) - 1.0).abs() < 1e-12);
        assert!(like(0.5) < 0.99 && like(1.5) < like(0.5) && like(4.0) < like(1.5) && like(9.0) < 0.1);
    }
}
