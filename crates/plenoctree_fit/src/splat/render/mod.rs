//! Draws captures as their trainers do: EWA splatting (Zwicker et al. 2001; Kerbl et al. 2023), in float32 and on all
//! cores.

mod project;
mod tiles;

pub use project::SPLAT_BLUR;

use glam::{DVec3, Vec3, Vec4};
use plenoctree::camera::PinholeCamera;
use rayon::prelude::*;

use self::{
    project::{Projected, project},
    tiles::{TILE, draw_row},
};
use super::splats::Splats;

/// An image of a capture, without a background. Pixels are stored row by row, from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Encoded sRGB, premultiplied by opacity, and opacity. Colors can be above 1.
    pub pixels: Vec<Vec4>,
}

impl SplatImage {
    /// Composites the image over `background`. Colors are encoded sRGB, clamped to 0..=1.
    pub fn over(&self, background: DVec3) -> Vec<DVec3> {
        let over = |pixel: &Vec4| {
            let pixel = pixel.as_dvec4();
            (pixel.truncate() + (1.0 - pixel.w) * background).clamp(DVec3::ZERO, DVec3::ONE)
        };
        self.pixels.iter().map(over).collect()
    }
}

/// Draws the capture as `camera` sees it, on all cores of the current rayon pool. The image is the same on any number
/// of threads.
///
/// Each Gaussian is projected by the derivative of the projection at its center, and made wider by 0.3 square pixels,
/// so that none falls between pixels. Gaussians are blended from front to back, in the order of their centers' depths,
/// with an opacity of at most 0.99; below 1/255, they are left out. If the capture was trained with antialiasing
/// ([`Splats::antialiased`]), opacities fall as areas grow. Those nearer than 0.01 units and than
/// their own largest standard deviation are left out as well.
pub fn render_splats(splats: &Splats, camera: &PinholeCamera) -> SplatImage {
    let (width, height) = (camera.width, camera.height);
    SplatImage {
        width,
        height,
        pixels: draw(splats, camera, |index, direction| splats.color(index, direction), |_, _| ()),
    }
}

/// Draws the capture like [`render_splats`], in colors that may be others: `color` returns that of an index in a
/// direction. Calls `show` with the index of each Gaussian that is drawn and the sum of its weights in a tile of the
/// image, in pixels: in any order, but with the same sums on any number of threads.
pub(super) fn draw(
    splats: &Splats,
    camera: &PinholeCamera,
    color: impl Fn(usize, DVec3) -> Vec3 + Sync,
    show: impl Fn(u32, f32) + Sync,
) -> Vec<Vec4> {
    if camera.width == 0 || camera.height == 0 {
        return Vec::new();
    }
    // The lines that each Gaussian reaches are apart from the rest, because every row of tiles looks at those of all.
    let (lines, projected): (Vec<[f32; 2]>, Vec<Projected>) = (0..splats.len())
        .into_par_iter()
        .with_min_len(1024)
        .filter_map(|index| project(splats, index, camera, &color))
        .map(|gaussian| (gaussian.span(1), gaussian))
        .unzip();
    let columns = camera.width as usize;
    let mut pixels = vec![Vec4::ZERO; columns * camera.height as usize];
    pixels.par_chunks_mut(columns * TILE).enumerate().for_each(|(row, pixels)| {
        draw_row(&projected, &lines, row * TILE, columns, pixels, |gaussian, sum| show(gaussian.index, sum));
    });
    pixels
}

#[cfg(test)]
mod tests {
    use glam::{DMat2, DMat3, DMat4, DVec2, Quat};
    use proptest::prelude::*;

    use super::*;
    use crate::splat::Gaussian;

    /// The same in float64 and from the definition: covariances in full, every Gaussian at every pixel.
    fn reference(splats: &Splats, camera: &PinholeCamera) -> Vec<[f64; 4]> {
        let to_camera = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * camera.rotation.transpose();
        let mut order: Vec<(f64, usize)> = (splats.gaussians().iter().enumerate())
            .map(|(index, gaussian)| ((to_camera * (gaussian.position.as_dvec3() - camera.position)).z, index))
            .filter(|(depth, index)| *depth > f64::from(splats.gaussians()[*index].scale.max_element()).min(0.01))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut pixels = vec![[0.0, 0.0, 0.0, 1.0]; (camera.width * camera.height) as usize];
        for (_, index) in order {
            let gaussian = splats.gaussians()[index];
            let axes = DMat3::from_quat(gaussian.rotation.as_dquat().normalize());
            let variances = gaussian.scale.as_dvec3() * gaussian.scale.as_dvec3();
            let covariance =
                to_camera * axes * DMat3::from_diagonal(variances) * axes.transpose() * to_camera.transpose();
            let at = to_camera * (gaussian.position.as_dvec3() - camera.position);
            let limit = |x: f64, size: u32, focal: f64| {
                x.clamp(-0.65 * f64::from(size) / focal, 0.65 * f64::from(size) / focal)
            };
            let (x, y) =
                (limit(at.x / at.z, camera.width, camera.focal_x), limit(at.y / at.z, camera.height, camera.focal_y));
            let row =
                [DVec3::new(1.0, 0.0, -x) * camera.focal_x / at.z, DVec3::new(0.0, 1.0, -y) * camera.focal_y / at.z];
            let entry = |a: usize, b: usize| row[a].dot(covariance * row[b]);
            let own = DMat2::from_cols_array(&[entry(0, 0), entry(0, 1), entry(0, 1), entry(1, 1)]);
            let blurred = own + DMat2::from_diagonal(DVec2::splat(0.3));
            let flat = blurred.inverse();
            let mut opacity = f64::from(gaussian.opacity);
            if splats.antialiased() {
                opacity *= (own.determinant() / blurred.determinant()).max(0.0).sqrt();
            }
            let center = DVec2::new(
                camera.focal_x * at.x / at.z + camera.center_x,
                camera.focal_y * at.y / at.z + camera.center_y,
            );
            let color = splats.color(index, (gaussian.position.as_dvec3() - camera.position).normalize());
            for (number, pixel) in pixels.iter_mut().enumerate() {
                let (column, line) = (number as u32 % camera.width, number as u32 / camera.width);
                let offset = DVec2::new(f64::from(column) + 0.5, f64::from(line) + 0.5) - center;
                let alpha = (opacity * (-0.5 * offset.dot(flat * offset)).exp()).min(0.99);
                if alpha >= 1.0 / 255.0 {
                    (0..3).for_each(|channel| pixel[channel] += pixel[3] * alpha * f64::from(color[channel]));
                    pixel[3] *= 1.0 - alpha;
                }
            }
        }
        pixels
    }

    fn vector(low: f32, high: f32) -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(low..high).prop_map(Vec3::from_array)
    }

    fn gaussian() -> impl Strategy<Value = (Gaussian, Vec<Vec3>)> {
        let shape = (vector(-1.5, 1.5), vector(-5.0, -0.5), prop::array::uniform4(-1.0f32..1.0), 0.0f32..1.0);
        (shape, prop::collection::vec(vector(-0.7, 0.7), 16)).prop_map(
            |((position, scale, rotation, opacity), color)| {
                let rotation = Quat::from_array(rotation);
                let rotation = if rotation.length() > 0.1 { rotation } else { Quat::IDENTITY };
                let scale = Vec3::from_array(scale.to_array().map(f32::exp));
                (Gaussian { position, scale, rotation, opacity }, color)
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Tiles, sorting and float32 do not change the result, for any image size, degree and camera position, outside
        /// or among the Gaussians.
        #[test]
        fn images_are_those_of_the_reference(
            gaussians in prop::collection::vec(gaussian(), 1..60),
            degree in 0u32..4,
            antialiased: bool,
            size in (20u32..70, 20u32..50),
            from in vector(-4.0, 4.0),
            off_center in -5.0f64..5.0,
        ) {
            let mut splats = Splats::new(degree);
            splats.set_antialiased(antialiased);
            for (gaussian, coefficients) in &gaussians {
                splats.push(*gaussian, &coefficients[..(degree as usize + 1).pow(2)]);
            }
            let mut camera = PinholeCamera::new(size.0, size.1, 0.9, DMat4::IDENTITY);
            camera.center_x += off_center;
            let camera = camera.looking_at(from.as_dvec3(), DVec3::new(0.1, 0.2, -0.1), DVec3::Z);
            let image = render_splats(&splats, &camera);
            let expected = reference(&splats, &camera);
            let mut sum = 0.0;
            for (pixel, expected) in image.pixels.iter().zip(&expected) {
                let [r, g, b, through] = *expected;
                let difference = (pixel.as_dvec4() - glam::DVec4::new(r, g, b, 1.0 - through)).abs().max_element();
                // A Gaussian at the threshold is sometimes in one image and not in the other.
                prop_assert!(difference < 0.012, "{pixel} {expected:?}");
                sum += difference;
            }
            prop_assert!(sum / (expected.len() as f64) < 2e-4, "{sum}");
        }
    }

    /// Returns many Gaussians within a cube that is two `units` wide, and a camera that sees them.
    fn scene(unit: f32) -> (Splats, PinholeCamera) {
        let mut splats = Splats::new(0);
        for index in 0..3000 {
            let at = |step: f32| (step * index as f32).sin();
            let position = unit * Vec3::new(at(0.7), at(1.3), at(2.9));
            let color = Vec3::new(at(0.2), at(0.3), at(0.5));
            let scale = unit * Vec3::new(0.02, 0.05, 0.01);
            splats.push(Gaussian { position, scale, rotation: Quat::IDENTITY, opacity: 0.5 }, &[color]);
        }
        let position = f64::from(unit) * DVec3::new(3.0, 1.0, 1.0);
        let camera = PinholeCamera::new(100, 70, 0.9, DMat4::IDENTITY).looking_at(position, DVec3::ZERO, DVec3::Z);
        (splats, camera)
    }

    /// Captures may have any unit.
    #[test]
    fn images_do_not_depend_on_units() {
        let [expected, small, large] = [1.0, 1e-3, 1e3].map(|unit| {
            let (splats, camera) = scene(unit);
            render_splats(&splats, &camera).pixels
        });
        for found in [small, large] {
            let differs = |(found, expected): &(Vec4, &Vec4)| (*found - **expected).abs().max_element() > 1e-3;
            assert_eq!(found.into_iter().zip(&expected).filter(differs).count(), 0);
        }
    }

    /// Cameras without pixels see images without pixels.
    #[test]
    fn images_may_be_empty() {
        let (splats, camera) = scene(1.0);
        for (width, height) in [(0, 70), (100, 0), (0, 0)] {
            let new = PinholeCamera::new(width, height, 0.9, DMat4::IDENTITY);
            let new = new.looking_at(camera.position, DVec3::ZERO, DVec3::Z);
            assert!(render_splats(&splats, &new).pixels.is_empty());
            let image = render_splats(&splats, &PinholeCamera { width, height, ..camera });
            assert_eq!((image.width, image.height, image.pixels.len()), (width, height, 0));
        }
    }

    /// The image is the same on any number of threads.
    #[test]
    fn images_do_not_depend_on_threads() {
        let (splats, camera) = scene(1.0);
        let images = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render_splats(&splats, &camera))
        });
        assert_eq!(images[0], images[1]);
        assert!(images[0].pixels.iter().any(|pixel| pixel.w > 0.5));
    }
}
