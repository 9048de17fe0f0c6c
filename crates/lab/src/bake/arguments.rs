//! The arguments of `bake`.

use std::path::{Path, PathBuf};

use clap::Args;

/// Bake the included props, and pack them; or take pictures of them.
#[derive(Args)]
pub struct Arguments {
    /// The folder for the files; by default assets, or out for pictures.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// The number of levels of cells; the default depends on the prop.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10))]
    pub depth: Option<u32>,
    /// Write the fields as they are, to .npz files, instead of packing them.
    #[arg(long)]
    pub npz: bool,
    /// Take this many path-traced pictures of each prop instead, to fit fields to. They go to folders named like the
    /// props.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(conflicts_with_all = ["depth", "npz"])]
    pub pictures: Option<u32>,
    /// The width and height of these pictures, in pixels.
    #[arg(long, default_value_t = 400, value_parser = clap::value_parser!(u32).range(1..=4096), requires = "pictures")]
    pub size: u32,
    /// The props; by default all that are baked.
    pub names: Vec<String>,
}

impl Arguments {
    /// Returns the folder for the files.
    pub fn folder(&self) -> &Path {
        let default = if self.pictures.is_some() { "out" } else { "assets" };
        self.out.as_deref().unwrap_or(Path::new(default))
    }
}
