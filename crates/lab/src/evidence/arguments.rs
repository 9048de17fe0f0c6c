//! The arguments of `evidence`.

use std::path::PathBuf;

use clap::Args;
use plenoctree_cli::{renderer::Renderer, size::parse_size};

/// Compare the field's palette with those of other methods, as the paper's figures do, and write a report.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; by default the included toadstool.
    pub field: Option<PathBuf>,
    /// A transforms.json file (NeRF, nerfstudio) in the field's coordinates; by default the views are on a turntable.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// The folder for report.md, report.html and their pictures and data.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// Size of the pictures in pixels, each side 1 to 16384; by default 320 on the longer side.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// The number of views that show results.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub views: u32,
    /// The number of frames in the turn of 90 degrees.
    #[arg(long, default_value_t = 61, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: u32,
    /// The number of colors of every palette. More than 32 would have too many labels.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=32))]
    pub colors: u32,
    /// The renderer.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: Renderer,
    /// Print only warnings and errors.
    #[arg(long)]
    pub quiet: bool,
}
