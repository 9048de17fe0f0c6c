//! The arguments of `coherence`.

use std::path::PathBuf;

use clap::Args;
use plenoctree_cli::{renderer::Renderer, size::parse_size};

/// Measure how much neighboring frames differ with one palette for the field, and with one for each frame.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; by default the included toadstool.
    pub field: Option<PathBuf>,
    /// The folder for coherence.svg and coherence.csv.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// The number of frames in a turn of 90 degrees.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: u32,
    /// Size of the frames in pixels.
    #[arg(long, value_name = "WxH", default_value = "400x400", value_parser = parse_size)]
    pub size: (u32, u32),
    /// The renderer.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: Renderer,
    /// Print only warnings and errors.
    #[arg(long)]
    pub quiet: bool,
}
