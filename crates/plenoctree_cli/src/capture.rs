//! Reads captures.

use std::path::Path;

use clap::{Args, ValueEnum};
use plenoctree_fit::splat::{SplatSettings, Splats, SpzAxes};

use crate::{console, progress, result::Result};

/// How to read a capture.
#[derive(Args, Clone, Copy)]
pub struct CaptureArguments {
    /// The axes of an SPZ file that does not record them. Without this, rub, with a warning.
    #[arg(long, value_enum)]
    spz_axes: Option<Axes>,
}

/// The axes of SPZ files.
#[derive(Clone, Copy, ValueEnum)]
enum Axes {
    /// Right, up and back, as the format specifies.
    Rub,
    /// Right, down and front, as splat-transform 3, SuperSplat and Niantic's ply_to_spz write them.
    Rdf,
}

/// Returns an error for the file of a capture, where something else is expected.
pub fn refuse(path: &Path) -> Result {
    if ["ply", "spz", "sog", "splat"]
        .iter()
        .any(|capture| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(capture)))
    {
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
    let splats = Splats::read(path, &SplatSettings { spz_axes })?;
    spinner.finish_and_clear();
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
    Ok(splats)
}
