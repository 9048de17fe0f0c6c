//! Makes PlenOctrees: fits them to photographs, converts captures of Gaussian splats, and simplifies fields for
//! packing.
//!
//! | what | contents |
//! |---|---|
//! | [`fit()`] | finds a field that looks like photographs, which [`FitInput`] reads |
//! | [`refine()`] | the same, but starts from a field |
//! | [`simplify()`] | makes a field easier to pack |
//! | [`read_transforms`] | reads the cameras of `transforms.json` files |
//! | [`splat`] | captures: reads and draws them, and converts them to fields |
//!
//! Fitting needs no GPU: rays are marched exactly, gradients are computed by hand, and voxels are split, from 64 to 256
//! and more per side, where something is visible. `docs/fit.md` in the repository describes the method and what each
//! part of it contributes.
//!
//! ```no_run
//! # #[cfg(feature = "fit")]
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use std::path::Path;
//! use plenoctree_fit::{FitInput, FitProgress, FitSettings, InputFolders, fit};
//!
//! let input = FitInput::read(Path::new("photographs"), &InputFolders::default())?;
//! let fitted = fit(&input, None, &FitSettings::default(), &FitProgress::default())?;
//! fitted.field.write("prop.npz")?;
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "fit"))]
//! # fn main() {}
//! ```
//!
//! # Features
//!
//! | feature | adds | default |
//! |---|---|---|
//! | `fit` | fitting fields to photographs, and everything else at the root of the crate | on |
//! | `splat` | captures of Gaussian splats | on |
#![cfg_attr(docsrs, feature(doc_cfg))]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[cfg(any(feature = "fit", feature = "splat"))]
mod cells;
#[cfg(any(feature = "fit", feature = "splat"))]
mod exponential;
#[cfg(any(feature = "fit", feature = "splat"))]
mod file;
#[cfg(any(feature = "fit", feature = "splat"))]
mod finest;
#[cfg(feature = "fit")]
mod fit;
#[cfg(feature = "splat")]
pub mod splat;

#[cfg(feature = "fit")]
pub use fit::{
    Comparison, Distortion, FitError, FitInput, FitProgress, FitReport, FitSettings, FitStatus, Fitted, HeldOut,
    InputFolders, Lens, Picture, RefineSettings, Refined, RoundReport, Seconds, Shot, SimplifySettings, StageReport,
    SuspiciousView, Transforms, View, ViewCamera, ViewReport, decibels, fit, read_transforms, refine, simplify, ssim,
};
