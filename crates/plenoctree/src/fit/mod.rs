//! Fits fields to photographs.
//!
//! [`FitInput::read`] reads pictures and cameras, and [`fit`] finds a field that looks like the pictures. It needs no
//! GPU: rays are marched exactly, gradients are computed by hand, and voxels are split, from 64 to 256 and more per
//! side, where something is visible. [`refine()`] starts from a field instead, and [`simplify()`] makes fields easier
//! to pack. `docs/fit.md` in the repository describes the method and what each part of it contributes.
//!
//! ```no_run
//! use std::path::Path;
//! use plenoctree::fit::{FitInput, FitProgress, FitSettings, InputFolders, fit};
//!
//! let input = FitInput::read(Path::new("photographs"), &InputFolders::default())?;
//! let fitted = fit(&input, None, &FitSettings::default(), &FitProgress::default())?;
//! fitted.field.write("prop.npz")?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod checkpoint;
mod error;
mod grid;
mod input;
mod measure;
mod progress;
mod random;
mod refine;
mod report;
mod run;
mod scene;
mod settings;
mod simplify;
mod stand;
mod suspects;
mod to_field;
mod train;

pub use error::FitError;
pub use input::{Distortion, FitInput, InputFolders, Lens, Picture, View, ViewCamera};
pub use measure::{Comparison, ssim};
pub use progress::{FitProgress, FitStatus};
pub use refine::{RefineSettings, Refined, Shot, refine};
pub use report::{FitReport, HeldOut, Seconds, StageReport, SuspiciousView, ViewReport};
pub use run::{Fitted, fit};
pub use settings::FitSettings;
pub use simplify::{SimplifySettings, simplify};
