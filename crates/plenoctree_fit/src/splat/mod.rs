//! Captures: scenes of Gaussian splats, as phones and 3D editors export them.
//!
//! [`Splats::read`] reads the common formats, [`render_splats`] draws them, [`Splats::subject`] finds the part to
//! convert, and [`voxelize()`] converts it to a field.
//!
//! ```no_run
//! use plenoctree_fit::splat::{SplatSettings, Splats, VoxelSettings, voxelize};
//!
//! let splats = Splats::read("bonsai.ply", &SplatSettings::default())?;
//! let field = voxelize(&splats, &VoxelSettings::default())?;
//! field.write("bonsai.npz")?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis;
mod bounds;
mod error;
mod harmonics;
mod read;
mod render;
mod shape;
mod splats;
mod subject;
mod voxelize;

pub use axis::Axis;
pub use error::SplatError;
pub use read::{SplatSettings, SpzAxes};
pub use render::{SPLAT_BLUR, SplatImage, render_splats};
pub use splats::{Gaussian, Splats};
pub use subject::{Subject, SubjectSettings};
pub use voxelize::{VoxelSettings, Voxels, voxelize};
