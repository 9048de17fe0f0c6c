//! The arguments of `tradeoff`.

use std::path::PathBuf;

use clap::Args;
use plenoctree_cli::{field, size::parse_size};

/// Measure time, PSNR and SSIM against float64, changed labels and flicker for every quality setting and every preset.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; by default the included toadstool.
    field: Option<PathBuf>,
    /// A transforms.json file (NeRF, nerfstudio) in the field's coordinates, to use instead of a turntable.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Size of the images in pixels.
    #[arg(long, value_name = "WxH", default_value = "400x400", value_parser = parse_size)]
    pub size: (u32, u32),
    /// The folder for the tables and the plots.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// The number of views to measure.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub views: u32,
    /// The number of rounds in which all variants are timed, alternately.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
}

impl Arguments {
    /// Returns the field's path.
    pub fn field(&self) -> PathBuf {
        field::or_default(self.field.as_deref())
    }
}
