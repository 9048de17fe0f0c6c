//! Compares views of the field with photographs.

use glam::{DVec2, DVec3, Vec3};
use plenoctree::PlenOctree;
use rayon::prelude::*;

use super::{
    grid::Grid,
    input::{Picture, ViewCamera},
    report::ViewReport,
    train::{TrainView, backdrop::Backdrop, batch::render_ray},
};

/// The longest side of a [`Comparison`], in pixels.
const LONGEST: u32 = 1024;
/// Rows of an image whose similarity is computed at a time.
const BAND: usize = 64;
/// The reach of a window of similarity, in pixels.
const REACH: usize = 5;

/// A view of the field, next to the photograph. Pixels are stored row by row, in encoded sRGB. They are means of those of
/// the photograph if a side of it is longer than 1024 pixels.
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
}

/// Renders the field, as it is written to files, with the reference's march in float64, and compares what is known.
/// The rest is black in both.
pub fn compare(
    field: &PlenOctree,
    backdrop: &Backdrop,
    name: &str,
    camera: &ViewCamera,
    picture: &Picture,
) -> (Comparison, ViewReport) {
    let (width, height) = (camera.width, camera.height);
    // In float32, because photographs have many pixels.
    let pairs: Vec<[Vec3; 2]> = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            if !camera.knows(x, y) {
                return [Vec3::ZERO; 2];
            }
            let direction = camera.direction(DVec2::new(x.into(), y.into()) + 0.5);
            let (seen, opacity) = field.render_ray(camera.position, direction);
            let behind = backdrop.color(direction, Vec3::ONE).as_dvec3();
            let [r, g, b, a] = picture.pixels[pixel as usize].map(|byte| f64::from(byte) / 255.0);
            [seen + (1.0 - opacity) * behind, DVec3::new(r, g, b) + (1.0 - a) * behind].map(|color| color.as_vec3())
        })
        .collect();
    let pair = |pixel: usize| pairs[pixel].map(|color| color.as_dvec3());
    let all = || (0..pairs.len()).map(pair);
    let squared: f64 = all().map(|[a, b]| a.distance_squared(b)).sum();
    let known = |pixel: usize| camera.knows(pixel as u32 % width, pixel as u32 / width);
    let count = 3.0 * (0..pairs.len()).filter(|pixel| known(*pixel)).count().max(1) as f64;
    let gain: DVec3 = {
        let product: DVec3 = all().map(|[a, b]| a * b).sum();
        let square: DVec3 = all().map(|[a, _]| a * a).sum();
        product / square.max(DVec3::splat(1e-9))
    };
    let aligned: f64 = all().map(|[a, b]| (gain * a).distance_squared(b)).sum();
    let factor = width.max(height).div_ceil(LONGEST);
    let small = [(width / factor).max(1), (height / factor).max(1)];
    let bytes = |side: usize| {
        let mean = |(x, y): (u32, u32)| {
            let (columns, rows) = (factor.min(width), factor.min(height));
            let inside = (0..rows).flat_map(|dy| (0..columns).map(move |dx| (dx, dy)));
            let sum: DVec3 =
                inside.map(|(dx, dy)| pair(((y * rows + dy) * width + x * columns + dx) as usize)[side]).sum();
            let mean = sum / f64::from(rows * columns);
            mean.to_array().map(|x| (255.0 * x.clamp(0.0, 1.0)).round() as u8)
        };
        (0..small[1]).flat_map(|y| (0..small[0]).map(move |x| (x, y))).map(mean).collect()
    };
    let [photographed, rendered] = [1, 0].map(bytes);
    let comparison = Comparison { name: name.into(), width: small[0], height: small[1], photographed, rendered };
    let report = ViewReport {
        name: name.into(),
        psnr_db: decibels(squared / count),
        ssim: similarity(pairs.len(), width as usize, pair, known),
        aligned_psnr_db: decibels(aligned / count),
    };
    (comparison, report)
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

/// Converts a mean squared error of encoded sRGB to decibels of PSNR: 100 at most.
pub fn decibels(mean_squared: f64) -> f64 {
    -10.0 * mean_squared.max(1e-10).log10()
}

/// Returns the structural similarity of two images whose rows are `width` pixels wide, at most 1: the mean over all
/// pixels and channels, in Gaussian windows of 11 x 11 pixels with a standard deviation of 1.5 (Wang et al. 2004).
/// Colors are in encoded sRGB.
///
/// # Panics
///
/// Panics if the images have different sizes, or do not consist of whole rows.
pub fn ssim(a: &[DVec3], b: &[DVec3], width: usize) -> f64 {
    assert!(a.len() == b.len() && a.len().is_multiple_of(width), "images of whole rows");
    similarity(a.len(), width, |pixel| [a[pixel], b[pixel]], |_| true)
}

/// Returns the mean over those of `count` pixels for which `counts` returns `true`. `pair` returns the colors of a pixel.
/// Bands of rows are computed one by one on each thread, because large images would need gigabytes.
fn similarity(
    count: usize,
    width: usize,
    pair: impl Fn(usize) -> [DVec3; 2] + Sync,
    counts: impl Fn(usize) -> bool + Sync,
) -> f64 {
    let (c1, c2) = (0.01f64.powi(2), 0.03f64.powi(2));
    let height = count / width;
    let of_band = |band: usize| {
        let rows = band * BAND..height.min((band + 1) * BAND);
        // Windows reach into other bands.
        let first = rows.start.saturating_sub(REACH) * width;
        let pairs: Vec<[DVec3; 2]> = (first..height.min(rows.end + REACH) * width).map(&pair).collect();
        let blurred = |f: &dyn Fn([DVec3; 2]) -> DVec3| blur(pairs.iter().map(|pair| f(*pair)).collect(), width);
        let (mean_a, mean_b) = (blurred(&|[a, _]| a), blurred(&|[_, b]| b));
        let (aa, bb, ab) = (blurred(&|[a, _]| a * a), blurred(&|[_, b]| b * b), blurred(&|[a, b]| a * b));
        let pixels = (rows.start * width..rows.end * width).filter(|pixel| counts(*pixel));
        pixels.fold((DVec3::ZERO, 0), |(sum, count), pixel| {
            let i = pixel - first;
            let (ma, mb) = (mean_a[i], mean_b[i]);
            let (va, vb, cov) = (aa[i] - ma * ma, bb[i] - mb * mb, ab[i] - ma * mb);
            let similarity = (2.0 * ma * mb + c1) * (2.0 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
            (sum + similarity, count + 1)
        })
    };
    let bands: Vec<(DVec3, usize)> = (0..height.div_ceil(BAND)).into_par_iter().map(of_band).collect();
    let (sum, count) = bands.iter().fold((DVec3::ZERO, 0), |all, band| (all.0 + band.0, all.1 + band.1));
    sum.element_sum() / (3.0 * count.max(1) as f64)
}

/// Blurs an image with a Gaussian window of 11 x 11 pixels. At the edges, the window is cut off.
fn blur(image: Vec<DVec3>, width: usize) -> Vec<DVec3> {
    let weights: [f64; 2 * REACH + 1] =
        std::array::from_fn(|i| (-(i as f64 - REACH as f64).powi(2) / (2.0 * 1.5 * 1.5)).exp());
    let height = image.len() / width;
    let pass = |source: &[DVec3], length: usize, stride: usize, place: &dyn Fn(usize) -> usize| {
        let at = |index: usize| {
            let at = place(index);
            let (mut sum, mut total) = (DVec3::ZERO, 0.0);
            for (tap, weight) in weights.iter().enumerate() {
                if let Some(other) = (at + tap).checked_sub(REACH).filter(|other| *other < length) {
                    sum += *weight * source[index + other * stride - at * stride];
                    total += weight;
                }
            }
            sum / total
        };
        (0..source.len()).map(at).collect::<Vec<_>>()
    };
    let rows = pass(&image, width, 1, &|index| index % width);
    pass(&rows, height, width, &|index| index / width)
}

#[cfg(test)]
mod tests {
    use glam::DMat3;
    use plenoctree::{BakeSettings, Basis, bake};

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
        let noise = similarity(64 * 64, 64, |at| [a[at], b[at]], |at| at % 64 >= 40);
        assert!(all > 0.4 && noise < 0.1, "{all} {noise}");
    }

    /// Large photographs are averaged, but compared pixel by pixel.
    #[test]
    fn comparisons_of_large_photographs_are_small() {
        let settings = BakeSettings { depth: 2, basis: Basis::Rgba, directions: 8, ..Default::default() };
        let nothing = bake(&settings, |_| 0.0, |_| |_| DVec3::ONE).unwrap();
        let camera = ViewCamera::centered([2100, 7], 1.0, DMat3::IDENTITY, DVec3::ZERO);
        let pixels = (0..2100 * 7).map(|at| [[0, 51, 255], [51, 102, 0], [102, 0, 255]][at % 3]);
        let pixels = pixels.map(|[r, g, b]| [r, g, b, 255]).collect();
        let picture = Picture { width: 2100, height: 7, pixels, knows_opacity: false };
        let (found, report) = compare(&nothing, &Backdrop::Color(Vec3::ZERO), "a", &camera, &picture);
        assert_eq!((found.width, found.height, found.photographed.len()), (700, 2, 1400));
        assert!(found.photographed.iter().all(|color| *color == [51, 51, 170]));
        assert!(found.rendered.iter().all(|color| *color == [0; 3]));
        let squares = [0.0, 0.04, 1.0, 0.04, 0.16, 0.0, 0.16, 0.0, 1.0];
        assert!((report.psnr_db - decibels(squares.iter().sum::<f64>() / 9.0)).abs() < 1e-4, "{report:?}");
    }

    /// Bands of rows give the same as windows around each pixel, whatever the height.
    #[test]
    fn similarity_is_that_of_whole_windows() {
        let width = 7;
        for height in [1, 5, 64, 67, 140] {
            let mut random = plenoctree::random::Random::new(height as u64);
            let mut image = || -> Vec<DVec3> {
                (0..width * height).map(|_| DVec3::from_array(std::array::from_fn(|_| random.fraction()))).collect()
            };
            let (a, b) = (image(), image());
            let mut expected = 0.0;
            for at in 0..width * height {
                // The weighted means of both images and of their products.
                let (mut means, mut total) = ([DVec3::ZERO; 5], 0.0);
                for other in 0..width * height {
                    let across = (at % width) as f64 - (other % width) as f64;
                    let down = (at / width) as f64 - (other / width) as f64;
                    if across.abs() < 6.0 && down.abs() < 6.0 {
                        let weight = (-(across * across + down * down) / 4.5).exp();
                        let (a, b) = (a[other], b[other]);
                        (0..5).for_each(|index| means[index] += weight * [a, b, a * a, b * b, a * b][index]);
                        total += weight;
                    }
                }
                let [ma, mb, aa, bb, ab] = means.map(|mean| mean / total);
                let similarity = (2.0 * ma * mb + 1e-4) * (2.0 * (ab - ma * mb) + 9e-4)
                    / ((ma * ma + mb * mb + 1e-4) * (aa - ma * ma + bb - mb * mb + 9e-4));
                expected += similarity.element_sum() / (3 * width * height) as f64;
            }
            assert!((ssim(&a, &b, width) - expected).abs() < 1e-9, "{height}");
        }
    }
}
