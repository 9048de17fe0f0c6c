//! The arguments of `bake`.

use std::path::PathBuf;

use clap::Args;

/// Bakes the repository's own props into .npz files.
#[derive(Args)]
pub struct Arguments {
    /// Folder for the files.
    #[arg(long, default_value = "assets")]
    pub out: PathBuf,
    /// Levels of the fields; each prop's own by default.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10))]
    pub depth: Option<u32>,
    /// Props to bake; all by default.
    pub names: Vec<String>,
}
