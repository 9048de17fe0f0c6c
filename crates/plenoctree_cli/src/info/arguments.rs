//! The arguments of `info`.

use std::path::PathBuf;

use clap::Args;

/// Print what a field or a palette contains.
#[derive(Args)]
pub struct Arguments {
    /// A field (an .npz or .plenoctree file) or a palette (a .json file).
    pub file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}
