//! The arguments of `coherence`.

use std::path::PathBuf;

use clap::Args;

use crate::size::parse_size;

/// Measures how much neighboring frames differ with one palette for the field, and with one for each frame.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz file; the toadstool of the repository by default.
    pub field: Option<PathBuf>,
    /// Where coherence.png and coherence.csv go.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// Frames of the turn by 90 degrees.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: u32,
    /// Size of the frames in pixels.
    #[arg(long, value_name = "WxH", default_value = "400x400", value_parser = parse_size)]
    pub size: (u32, u32),
    /// Prints nothing but errors.
    #[arg(long)]
    pub quiet: bool,
}
