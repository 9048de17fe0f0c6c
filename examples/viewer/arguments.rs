//! The command line.

use std::path::PathBuf;

use bevy_plenoctree::field::{LoadSettings, UpAxis};
use clap::{Parser, ValueEnum};

/// Shows a PlenOctree in a window, posterises it and changes its palette.
#[derive(Parser)]
pub struct Arguments {
    /// The field, an .npz file; one of our own props if none is given.
    field: Option<PathBuf>,
    /// A palette.json to use instead of extracting one.
    #[arg(long)]
    pub palette: Option<PathBuf>,
    /// The axis of the field that points up.
    #[arg(long, value_enum, default_value_t = Up::Z)]
    up: Up,
    /// Size of the window, or of the picture, in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x800", value_parser = parse_size)]
    pub size: (u32, u32),
    /// Opens no window: writes one picture to this file as soon as field and palette are there.
    #[arg(long, value_name = "FILE.png")]
    pub headless: Option<PathBuf>,
    /// How many more frames pass before the picture is taken.
    #[arg(long, value_name = "N", requires = "headless", default_value_t = 0)]
    pub at_frame: u32,
    /// Takes the picture with the panel beside the field.
    #[arg(long, requires = "headless")]
    pub panel: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Up {
    Y,
    Z,
}

impl Arguments {
    pub fn field(&self) -> PathBuf {
        let default = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/drum.npz");
        self.field.clone().unwrap_or_else(default)
    }

    pub fn load_settings(&self) -> LoadSettings {
        let up = match self.up {
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        };
        LoadSettings { up, ..LoadSettings::default() }
    }
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|pixels| (64..=8192).contains(pixels));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| "expected WxH, each from 64 to 8192".into())
}
