//! Fits fields to photographs.

mod checkpoint;
mod error;
mod find;
mod grid;
mod input;
mod measure;
mod progress;
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
mod transforms;
mod turned_box;

pub use error::FitError;
pub use input::{Distortion, FitInput, InputFolders, Lens, Picture, View, ViewCamera};
pub use measure::{Comparison, decibels, ssim};
pub use progress::{FitProgress, FitStatus};
pub use refine::{RefineSettings, Refined, Shot, refine};
pub use report::{FitReport, HeldOut, RoundReport, Seconds, StageReport, SuspiciousView, ViewReport};
pub use run::{Fitted, fit};
pub use settings::FitSettings;
pub use simplify::{SimplifySettings, simplify};
pub use transforms::{Transforms, read_transforms};
