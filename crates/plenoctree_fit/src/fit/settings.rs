//! Settings of a fit.

use std::{path::PathBuf, time::Duration};

use glam::DVec3;
use plenoctree::Basis;

use super::error::FitError;

/// The fewest leaves that can be asked for.
const FEWEST_LEAVES: usize = 1000;

/// Settings of [`fit`](super::fit).
#[derive(Clone, Debug, PartialEq)]
pub struct FitSettings {
    /// The most leaves of the field. They are small where that improves pictures most. At least 1000, 1 million by
    /// default.
    pub leaves: usize,
    /// The most levels of cells, 6 to 10: the finest are `2^-depth` of the field's cube wide. By default, as many as
    /// make them about half a pixel wide, 7 to 9.
    pub depth: Option<u32>,
    /// Basis of the radiance: [`Basis::Sh1`], [`Basis::Sh4`], [`Basis::Sh9`] (the default) or [`Basis::Sh16`].
    pub basis: Basis,
    /// Average this many pixels, across and down, to one. At least 1, the default.
    pub downscale: u32,
    /// Lowest and highest corner of the box to fit, in the frame of the cameras. By default, it is found from what the
    /// cameras see.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Color behind the field, in encoded sRGB, 0 to 1. By default, it is learned from opaque pictures; it is white in
    /// previews of pictures with opacity.
    pub background: Option<DVec3>,
    /// Of this many views, one is held out and measured. At least 2, 8 by default. `None` fits to all views.
    pub hold_out: Option<u32>,
    /// How much work to do, as a multiple of the default. Above 0, 1 by default.
    pub effort: f64,
    /// Time for training, which does not include reading the pictures and measuring the result. The field is then as
    /// good as the time allows, but differs from run to run. Stages that there is no time for are skipped. `None`, the
    /// default, does the work that `effort` specifies.
    pub time: Option<Duration>,
    /// Seed of the random numbers. The same seed gives the same field, on any number of threads, unless `time` is set.
    pub seed: u64,
    /// Keep only the largest connected part of the field.
    pub keep_largest: bool,
    /// Cut the field to this box, in the frame of the cameras, after it is fitted.
    pub crop: Option<(DVec3, DVec3)>,
    /// A file to which a checkpoint is written every minute and when training ends. It is there until you remove it, so
    /// that nothing is lost if the field cannot be saved. If it cannot be written, the fit goes on.
    pub checkpoint: Option<PathBuf>,
    /// Resume from the checkpoint if there is one, with its random numbers instead of those of `seed`. The field is then
    /// as good as if the fit had not been interrupted, but not identical.
    pub resume: bool,
    /// Turn the field so that the mean up direction of the cameras is its z axis, and place it on the origin. That
    /// direction follows from the EXIF orientation of the pictures or, without it, from how their cameras are turned.
    pub stand: bool,
    /// Memory for pictures, in bytes. If they need more, only some are loaded at a time. 1.5 GB by default.
    pub picture_memory: u64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            leaves: 1_000_000,
            depth: None,
            basis: Basis::Sh9,
            downscale: 1,
            bounds: None,
            background: None,
            hold_out: Some(8),
            effort: 1.0,
            time: None,
            seed: 0,
            keep_largest: false,
            crop: None,
            checkpoint: None,
            resume: false,
            stand: false,
            picture_memory: 1_500_000_000,
        }
    }
}

impl FitSettings {
    /// Returns whether the view with this index is held out, if no others are there to measure.
    pub fn holds_out(&self, index: usize) -> bool {
        self.hold_out.is_some_and(|every| index.is_multiple_of(every as usize))
    }

    /// Returns an error that names the first setting that is out of range.
    pub(super) fn validate(&self) -> Result<(), FitError> {
        let fault = |setting, found: String, expected| Err(FitError::Setting { setting, found, expected });
        if self.leaves < FEWEST_LEAVES {
            return fault("leaves", self.leaves.to_string(), "at least 1000");
        }
        if let Some(depth) = self.depth.filter(|depth| !(6..=10).contains(depth)) {
            return fault("depth", depth.to_string(), "6 to 10");
        }
        if ![Basis::Sh1, Basis::Sh4, Basis::Sh9, Basis::Sh16].contains(&self.basis) {
            return fault("basis", self.basis.name().into(), "SH1, SH4, SH9 or SH16");
        }
        if self.downscale == 0 {
            return fault("downscale", "0".into(), "at least 1");
        }
        for (setting, bounds) in [("bounds", self.bounds), ("crop", self.crop)] {
            if let Some((low, high)) = bounds
                && !(low.is_finite() && high.is_finite() && low.cmplt(high).all())
            {
                return fault(setting, format!("{low} to {high}"), "a lowest and a highest corner");
            }
        }
        if let Some(color) = self.background
            && !(color.cmpge(DVec3::ZERO).all() && color.cmple(DVec3::ONE).all())
        {
            return fault("background", color.to_string(), "encoded sRGB from 0 to 1");
        }
        if let Some(every) = self.hold_out.filter(|every| *every < 2) {
            return fault("hold_out", every.to_string(), "at least 2, or none");
        }
        check_effort(self.effort)
    }
}

/// Returns an error unless an effort is in its range.
pub(super) fn check_effort(effort: f64) -> Result<(), FitError> {
    let error = || FitError::Setting { setting: "effort", found: effort.to_string(), expected: "a number above 0" };
    if effort > 0.0 && effort.is_finite() { Ok(()) } else { Err(error()) }
}
