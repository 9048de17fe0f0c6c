//! Reports of fits.

use serde::Serialize;

use super::train::{Model, Position};

/// The input, the work and the result of a fit. Serializes to `report.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FitReport {
    /// Number of views fitted to.
    pub views: usize,
    /// Lowest and highest corner of the cube that was fitted, in the frame of the field.
    pub cube: [[f64; 3]; 2],
    /// The matrix, row by row, from the input's frame to the field's, if the field was turned upright.
    pub from_input: Option<[[f64; 4]; 4]>,
    /// How much the cameras agree on the direction that was turned up, if the field was: the length of their mean, at most
    /// 1. Below [`Self::LEAST_UP_AGREEMENT`], it is not certain.
    pub up_agreement: Option<f64>,
    /// Leaves of the field.
    pub leaves: usize,
    /// Levels of the field.
    pub depth: u32,
    /// The share of the voxels that are in the largest part, if only that is kept.
    pub largest_part: Option<f64>,
    /// Whether the fit was stopped early, in training or while it was measured.
    pub stopped: bool,
    /// Why the state of a fit that was stopped could not be saved. It cannot be resumed from there, but perhaps from an
    /// earlier checkpoint.
    pub unsaved: Option<String>,
    /// The views that were held out, or others that were given for measuring, and how well the field matches them
    /// before it is cut. `None` if there are none.
    pub held_out: Option<HeldOut>,
    /// The median PSNR of the views that were fitted to, in the pixels in which the picture or the field shows
    /// something, in decibels. `None` if the field is not in view.
    pub fitted_psnr_db: Option<f64>,
    /// The stages of training.
    pub stages: Vec<StageReport>,
    /// Seconds spent reading pictures and finding the box, training, and measuring.
    pub seconds: Seconds,
    /// Views that contradict the others: their poses are probably wrong.
    pub suspicious: Vec<SuspiciousView>,
    /// Exposure of each view relative to the mean, per channel, if it was learned.
    pub gains: Option<Vec<[f32; 3]>>,
}

impl FitReport {
    /// The least [`Self::up_agreement`] with which the field certainly stands.
    pub const LEAST_UP_AGREEMENT: f64 = 0.5;
}

/// How well the held-out views are matched.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct HeldOut {
    /// Mean PSNR of the views, in decibels.
    pub psnr_db: f64,
    /// Mean structural similarity of the views.
    pub ssim: f64,
    /// Mean PSNR after the exposure of each view is matched.
    pub aligned_psnr_db: f64,
    /// Each view.
    pub views: Vec<ViewReport>,
}

/// How well one view is matched.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ViewReport {
    /// Name of its picture.
    pub name: String,
    /// PSNR, in decibels.
    pub psnr_db: f64,
    /// Structural similarity, at most 1: the mean over all pixels and channels, in Gaussian windows of 11 x 11 pixels.
    pub ssim: f64,
    /// PSNR after the exposure is matched: each channel multiplied by the best factor.
    pub aligned_psnr_db: f64,
}

/// What a stage of training did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StageReport {
    /// Finest voxels per side.
    pub resolution: u32,
    /// Voxels at the end.
    pub voxels: usize,
    /// Rays trained on, in millions.
    pub million_rays: f64,
    /// Mean number of voxels on a ray.
    pub voxels_per_ray: f64,
    /// Seconds.
    pub seconds: f64,
    /// Mean PSNR of the held-out views after the stage, from some of their pixels, in decibels.
    pub psnr_db: Option<f64>,
}

/// What a round of refining did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RoundReport {
    /// The round as a stage. Its PSNR is that of the shots that are measured.
    #[serde(flatten)]
    pub stage: StageReport,
    /// What the round gained, in decibels.
    pub gain_db: Option<f64>,
}

impl StageReport {
    /// Reports on a stage that has ended at `position`. `psnr_db` is that of the held-out views.
    pub(super) fn new(model: &Model, position: &Position, psnr_db: Option<f64>) -> Self {
        Self {
            resolution: model.grid.resolution(),
            voxels: model.grid.len(),
            million_rays: position.rays as f64 * 1e-6,
            voxels_per_ray: position.samples as f64 / position.rays.max(1) as f64,
            seconds: position.seconds,
            psnr_db,
        }
    }
}

/// Seconds spent on each part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// Reading pictures and finding the box.
    pub preparing: f64,
    /// Training.
    pub training: f64,
    /// Measuring the result.
    pub measuring: f64,
}

/// A view that contradicts the others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SuspiciousView {
    /// Its index in the order of names.
    pub number: usize,
    /// Name of its picture.
    pub name: String,
    /// PSNR in the pixels in which the picture or the field shows something, in decibels. `None` if the field is not in
    /// view.
    pub psnr_db: Option<f64>,
}
