//! The arguments of `pack`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use plenoctree::PackSettings;

use crate::size::parse_size;

/// Packs a field into its shipping form, a tenth of the size.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz file.
    pub field: PathBuf,
    /// The packed file; by default next to the field, with the extension .plenoctree.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How small the file becomes, and how good its pictures stay.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Quality,
    /// Opacity that a leaf must add to a ray from outside to be kept; 0 keeps all leaves, for fields that are also seen
    /// from inside.
    #[arg(long)]
    hidden: Option<f32>,
    /// How much views from below the horizon count, compared with others, from 0 to 1.
    #[arg(long)]
    below: Option<f32>,
    /// Largest number of rows of the codebook of luma; that of color differences has half as many.
    #[arg(long)]
    rows: Option<u32>,
    /// Writes the quantized .npz layout that volrend reads instead; --out is then required.
    #[arg(long, requires = "out")]
    pub npz: bool,
    /// A transforms.json file (NeRF, nerfstudio) in the field's coordinates, to measure from instead of from around the
    /// field.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Size of the measured views in pixels; by default 200x200, or the size in --cameras.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// The number of views to measure; 0 measures nothing.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub views: u32,
    /// A folder for a table and plots of size, accuracy and changed labels. Packs with every quality.
    #[arg(long, value_name = "FOLDER")]
    pub report: Option<PathBuf>,
}

/// Named settings of packing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Quality {
    /// For fields that are seen from afar.
    Small,
    /// For most fields.
    #[default]
    Balanced,
    /// For fields that are seen from close by.
    Fine,
}

impl Quality {
    /// Returns its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Small => "small",
            Self::Balanced => "balanced",
            Self::Fine => "fine",
        }
    }
}

impl Arguments {
    /// Returns the path of the packed file.
    pub fn out(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new(&self.field).with_extension("plenoctree"))
    }

    /// Returns the settings of a quality, with those that were given.
    pub fn settings(&self, quality: Quality) -> PackSettings {
        let settings = match quality {
            Quality::Small => PackSettings::SMALL,
            Quality::Balanced => PackSettings::BALANCED,
            Quality::Fine => PackSettings::FINE,
        };
        PackSettings {
            hidden: self.hidden.unwrap_or(settings.hidden),
            below: self.below.unwrap_or(settings.below),
            rows: self.rows.unwrap_or(settings.rows),
            ..settings
        }
    }
}
