//! The arguments of `bake`.

use std::path::PathBuf;

use clap::Args;

/// Bake the included props, and pack them.
#[derive(Args)]
pub struct Arguments {
    /// The folder for the files.
    #[arg(long, default_value = "assets")]
    pub out: PathBuf,
    /// The number of levels of cells; the default depends on the prop.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10))]
    pub depth: Option<u32>,
    /// Write the fields as they are, to .npz files, instead of packing them.
    #[arg(long)]
    pub npz: bool,
    /// The props to bake; by default all of them.
    pub names: Vec<String>,
}
