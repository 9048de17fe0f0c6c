//! Reads captures.

use std::{fs, path::Path};

use clap::{Args, ValueEnum};
use plenoctree_fit::splat::{SplatSettings, Splats, SpzAxes};

use crate::{console, progress, result::Result};

/// The extension of glTF for Gaussian splats.
const EXTENSION: &[u8] = b"KHR_gaussian_splatting";

/// How to read a capture.
#[derive(Args, Clone, Copy)]
pub struct CaptureArguments {
    /// The axes of an SPZ file that does not record them. Without this, rub, with a warning.
    #[arg(long, value_enum)]
    spz_axes: Option<Axes>,
    /// The capture was trained with antialiasing (Mip-Splatting), even if its file does not say so.
    #[arg(long)]
    antialiased: bool,
}

/// The axes of SPZ files.
#[derive(Clone, Copy, ValueEnum)]
enum Axes {
    /// Right, up and back, as the format specifies.
    Rub,
    /// Right, down and front, as splat-transform 3, SuperSplat and Niantic's ply_to_spz write them.
    Rdf,
}

impl CaptureArguments {
    /// Returns whether any is given.
    pub fn are_given(self) -> bool {
        self.spz_axes.is_some() || self.antialiased
    }
}

/// Returns an error for the file of a capture, where something else is expected.
pub fn refuse(path: &Path) -> Result {
    let ends_in = |endings: &[&str]| {
        let extension = path.extension().unwrap_or_default();
        endings.iter().any(|ending| extension.eq_ignore_ascii_case(ending))
    };
    // Models have the same endings.
    let names_extension =
        || fs::read(path).is_ok_and(|bytes| bytes.windows(EXTENSION.len()).any(|name| name == EXTENSION));
    if ends_in(&["ply", "spz", "sog", "splat"]) || ends_in(&["gltf", "glb"]) && names_extension() {
        return Err(format!("{}: found a capture of Gaussian splats; use `plenoctree convert`", path.display()).into());
    }
    Ok(())
}

/// Reads a capture, with a spinner unless `quiet`. Warns about axes that had to be assumed, and about Gaussians that
/// are left out.
pub fn load(path: &Path, arguments: CaptureArguments, quiet: bool) -> Result<Splats> {
    let spinner = progress::spinner("loading", quiet);
    let spz_axes = match arguments.spz_axes {
        None => SpzAxes::Unknown,
        Some(Axes::Rub) => SpzAxes::RightUpBack,
        Some(Axes::Rdf) => SpzAxes::RightDownFront,
    };
    let mut splats = Splats::read(path, &SplatSettings { spz_axes })?;
    splats.set_antialiased(splats.antialiased() || arguments.antialiased);
    spinner.finish_and_clear();
    let is_spz = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("spz"));
    if arguments.spz_axes.is_some() && !is_spz {
        console::complain!("warning: {}: --spz-axes is only for SPZ files", path.display());
    }
    if splats.assumes_axes() {
        console::complain!(
            "warning: {}: does not record its axes; if it is upside down, as files of splat-transform 3, SuperSplat \
             and Niantic's ply_to_spz are, add --spz-axes rdf (--spz-axes rub silences this)",
            path.display()
        );
    }
    if splats.dropped() > 0 {
        let (dropped, all) = (splats.dropped(), splats.dropped() + splats.len());
        console::complain!(
            "warning: {}: left out {dropped} of {all} Gaussians, because of damaged numbers",
            path.display()
        );
    }
    if splats.is_too_far() {
        console::complain!(
            "warning: {}: is so far from the origin that positions, in float32, are rounded by more than most Gaussians \
             are wide; move it to the origin before you export it",
            path.display()
        );
    }
    Ok(splats)
}
