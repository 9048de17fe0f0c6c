//! The command line.

use std::path::PathBuf;

use bevy_plenoctree::{LoadSettings, UpAxis};
use clap::{Parser, ValueEnum};

use crate::{quality::Level, show::Show};

/// Shows a PlenOctree in a window, posterizes it and edits its palette.
#[derive(Parser)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; one of the included props by default.
    field: Option<PathBuf>,
    /// A palette.json file to use instead of extracting a palette.
    #[arg(long)]
    pub palette: Option<PathBuf>,
    /// The up axis of the field.
    #[arg(long, value_enum, default_value_t = Up::Z)]
    up: Up,
    /// The quality preset.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Level,
    #[command(flatten)]
    pub show: Show,
    /// Includes the panel in the captured frame.
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
        let default = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/drum.plenoctree");
        self.field.clone().unwrap_or_else(default)
    }

    pub fn load_settings(&self) -> LoadSettings {
        let up = match self.up {
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        };
        LoadSettings { up: Some(up), ..LoadSettings::default() }
    }
}
