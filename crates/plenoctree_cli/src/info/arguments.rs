//! The arguments of `info`.

use std::path::PathBuf;

use clap::Args;

/// Prints what a field or a palette holds.
#[derive(Args)]
pub struct Arguments {
    /// A field (an .npz file) or a palette (a .json file).
    pub file: PathBuf,
    /// Prints JSON.
    #[arg(long)]
    pub json: bool,
}
