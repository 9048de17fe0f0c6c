//! The command line.

use std::path::PathBuf;

use bevy_plenoctree::{Activation, LoadSettings, PropQuality, UpAxis};
use clap::{
    Parser, ValueEnum,
    builder::{PossibleValuesParser, TypedValueParser},
};

use crate::show::Show;

/// Shows a PlenOctree in a window, posterizes it and edits its palette.
#[derive(Parser)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file; one of the included props by default.
    field: Option<PathBuf>,
    /// A palette.json file to use instead of extracting a palette.
    #[arg(long)]
    pub palette: Option<PathBuf>,
    /// How the numbers in the field's file become colors. By default, as a packed field records; otherwise sigmoid, or
    /// identity for RGBA.
    #[arg(long, value_enum)]
    activation: Option<Curve>,
    /// The axis that points up in the field. By default, the one that a packed field records; otherwise z.
    #[arg(long, value_enum)]
    up: Option<Up>,
    /// The quality preset.
    #[arg(long, default_value = "exact", value_parser = preset())]
    pub quality: PropQuality,
    #[command(flatten)]
    pub show: Show,
    /// Includes the panel in the captured frame.
    #[arg(long, requires = "headless")]
    pub panel: bool,
}

/// Parses the name of a preset.
fn preset() -> impl TypedValueParser<Value = PropQuality> {
    let names = PossibleValuesParser::new(PropQuality::PRESETS.map(|(name, _)| name));
    names.map(|name| PropQuality::PRESETS.into_iter().find(|(preset, _)| *preset == name).unwrap_or_default().1)
}

#[derive(Clone, Copy, ValueEnum)]
enum Up {
    Y,
    Z,
}

#[derive(Clone, Copy, ValueEnum)]
enum Curve {
    Sigmoid,
    ShiftedRelu,
    Identity,
}

impl Arguments {
    pub fn field(&self) -> PathBuf {
        let default = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/drum.plenoctree");
        self.field.clone().unwrap_or_else(default)
    }

    pub fn load_settings(&self) -> LoadSettings {
        let up = self.up.map(|up| match up {
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        });
        let activation = self.activation.map(|curve| match curve {
            Curve::Sigmoid => Activation::Sigmoid,
            Curve::ShiftedRelu => Activation::ShiftedRelu,
            Curve::Identity => Activation::Identity,
        });
        LoadSettings { activation, up, ..LoadSettings::default() }
    }
}
