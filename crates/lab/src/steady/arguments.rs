//! The arguments of `steady`.

use std::path::PathBuf;

use clap::Args;
use plenoctree_cli::size::parse_size;

/// Measure how many labels and lines flicker while the camera turns.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; by default the included toadstool.
    pub field: Option<PathBuf>,
    /// The number of frames.
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub frames: u32,
    /// Size of the frames in pixels.
    #[arg(long, value_name = "WxH", default_value = "400x400", value_parser = parse_size)]
    pub size: (u32, u32),
    /// How far the camera turns from frame to frame, in degrees.
    #[arg(long, default_value_t = 0.25)]
    pub turn: f64,
    /// The values of `Posterize::steadiness` to compare.
    #[arg(long, value_delimiter = ',', default_values_t = [0.0, 0.032])]
    pub steadiness: Vec<f32>,
    /// The width of lines, in world units.
    #[arg(long, default_value_t = 0.012)]
    pub ink: f32,
    /// Draw several samples per pixel.
    #[arg(long)]
    pub msaa: bool,
    /// Print only warnings and errors.
    #[arg(long)]
    pub quiet: bool,
}
