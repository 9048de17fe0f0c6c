//! The command line.

use std::path::PathBuf;

use bevy_plenoctree::{LoadSettings, UpAxis};
use clap::{Parser, ValueEnum};

use crate::{quality::Level, show::Show};

/// Shows a PlenOctree in a window, posterizes it and changes its palette.
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
    /// How exactly to draw.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Level,
    #[command(flatten)]
    pub show: Show,
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
