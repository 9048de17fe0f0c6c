//! The command line.

use std::path::PathBuf;

use clap::Parser;

use crate::size::parse_size;

/// Measures time, PSNR against float64, changed labels and flicker for every knob of quality and every preset.
#[derive(Parser)]
pub struct Arguments {
    /// The field, an .npz file; one of our own props if none is given.
    field: Option<PathBuf>,
    /// A transforms.json (NeRF, nerfstudio) in the field's frame, instead of a turntable.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Size of the pictures in pixels.
    #[arg(long, value_name = "WxH", default_value = "400x400", value_parser = parse_size)]
    pub size: (u32, u32),
    /// Where the table, the figures and the plots go.
    #[arg(long, default_value = "out")]
    pub out: PathBuf,
    /// Views that are measured.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub views: u32,
    /// How often everything is timed, by turns.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
}

impl Arguments {
    pub fn field(&self) -> PathBuf {
        let default = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.npz");
        self.field.clone().unwrap_or_else(default)
    }
}
