//! Gaussians among cells.

use glam::{DMat3, DVec3, Mat3, UVec3, Vec3};

use super::optics::{MOST_OPACITY, area};
use crate::splat::splats::{Gaussian, Splats};

/// Opacity below which a Gaussian is not drawn.
const FAINTEST: f64 = 1.0 / 255.0;
/// Smallest and largest square of the distance, in deviations, up to which a Gaussian is followed.
const REACH: [f64; 2] = [4.0, 9.0];
/// Smallest deviation of a Gaussian in a lattice of points, in their distances: between them, it is interpolated.
const SMOOTH: f64 = 3.0;

/// How a Gaussian shows.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// Its opacity.
    pub opacity: f64,
    /// The apparent area at which it has this opacity, in square cells and in multiples of pi.
    pub area: f64,
}

impl Shown {
    /// Returns how a Gaussian shows in cells of this width after a blur, in the mean of all directions.
    pub fn mean(splats: &Splats, gaussian: &Gaussian, width: f64, blur: f64) -> Self {
        Self { opacity: opacity(splats, gaussian, width, blur), area: area(widths(gaussian, width, blur)) }
    }
}

/// A Gaussian in cells: the cube spans 0 to the number of cells per side.
#[derive(Clone, Copy, Debug)]
pub struct CellGaussian {
    /// Its index in the capture.
    pub index: u32,
    pub center: Vec3,
    /// The inverse of its covariance.
    pub inverse: Mat3,
    /// Square of the distance, in deviations, up to which it is followed.
    pub reach: f32,
    /// Opacity that a ray meets at its center.
    pub opacity: f32,
    /// Factor of the profile's density.
    pub scale: f32,
    /// The distance, in cells, within which it is followed along each axis.
    pub extent: Vec3,
    /// How often cells can be merged, twice per axis, so that it is still smooth.
    pub level: u32,
    /// The cells in its reach: lowest, and behind the highest.
    pub low: UVec3,
    pub high: UVec3,
}

impl CellGaussian {
    /// Returns the Gaussian in the cells of a cube, or `None` if it does not reach the cube or is invisible.
    ///
    /// `blur` is a standard deviation in cells by which it is made wider. Its opacity stays the same, as when it is
    /// drawn, where it is blurred by half a pixel, or falls as its area grows if the capture is antialiased. It is
    /// [`Shown::mean`], unless it is `shown` otherwise.
    pub fn new(
        splats: &Splats,
        index: u32,
        corner: DVec3,
        width: f64,
        cells: u32,
        blur: f64,
        shown: Option<Shown>,
    ) -> Option<Self> {
        let gaussian = splats.gaussians()[index as usize];
        let center = (gaussian.position.as_dvec3() - corner) / width;
        let axes = DMat3::from_quat(gaussian.rotation.as_dquat().normalize());
        let widths = widths(&gaussian, width, blur);
        let Shown { opacity, area } = shown.unwrap_or_else(|| Shown::mean(splats, &gaussian, width, blur));
        if opacity < FAINTEST {
            return None;
        }
        let reach = (2.0 * (opacity / FAINTEST).ln() + 1.0).clamp(REACH[0], REACH[1]);
        let square = |widths: DVec3| axes * DMat3::from_diagonal(widths * widths) * axes.transpose();
        let covariance = square(widths);
        let extent = (DVec3::new(covariance.x_axis.x, covariance.y_axis.y, covariance.z_axis.z) * reach).map(f64::sqrt);
        let side = DVec3::splat(cells.into());
        let low = (center - extent - 0.5).ceil().clamp(DVec3::ZERO, side);
        let high = ((center + extent - 0.5).floor() + 1.0).clamp(DVec3::ZERO, side);
        if !low.cmplt(high).all() {
            return None;
        }
        Some(Self {
            index,
            center: center.as_vec3(),
            inverse: square(widths.recip()).as_mat3(),
            reach: reach as f32,
            opacity: opacity.min(MOST_OPACITY) as f32,
            scale: (area / widths.element_product()) as f32,
            extent: extent.as_vec3(),
            level: (widths.min_element() / SMOOTH).log2().max(0.0) as u32,
            low: low.as_uvec3(),
            high: high.as_uvec3(),
        })
    }
}

/// Returns the blurred half-widths of a Gaussian, in cells of this width.
pub fn widths(gaussian: &Gaussian, width: f64, blur: f64) -> DVec3 {
    let own = gaussian.scale.as_dvec3() / width;
    (own * own + blur * blur).map(f64::sqrt)
}

/// Returns the opacity of the blurred Gaussian.
pub fn opacity(splats: &Splats, gaussian: &Gaussian, width: f64, blur: f64) -> f64 {
    let opacity = f64::from(gaussian.opacity);
    if !splats.antialiased() {
        return opacity;
    }
    let area_of = |blur: f64| area(widths(gaussian, width, blur));
    opacity * area_of(0.0) / area_of(blur).max(f64::MIN_POSITIVE)
}
