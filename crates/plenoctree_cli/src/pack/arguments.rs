//! The arguments of `pack`.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use plenoctree::PackSettings;
use plenoctree_fit::SimplifySettings;

use crate::{field::FieldArguments, files, result::Result, size::parse_size};

/// Pack fields into their shipping form, a tenth of the size.
#[derive(Args)]
pub struct Arguments {
    /// The fields, .npz files; or packed ones, to pack them again.
    #[arg(required = true)]
    pub fields: Vec<PathBuf>,
    /// How to read the fields.
    #[command(flatten)]
    pub reading: FieldArguments,
    /// The packed file; by default next to the field, with the extension .plenoctree. For a single field.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How small the file becomes, and how accurate its pictures remain.
    #[arg(long, value_enum, default_value_t)]
    pub quality: Quality,
    /// Opacity that a leaf must add to a ray from outside to be kept, or less in fogs; 0 keeps all leaves, for fields
    /// that are also seen from inside. By default, --quality decides: 0.01, 0.004 or 0.001.
    #[arg(long)]
    hidden: Option<f32>,
    /// The weight of views from below the horizon, relative to others, from 0 to 1. By default 0.1, or 0.3 with
    /// --quality fine.
    #[arg(long)]
    below: Option<f32>,
    /// Largest number of rows of the codebook of luma; that of color differences has half as many. 1 to 65536;
    /// by default, --quality decides: 16384, 32768 or 65536.
    #[arg(long)]
    rows: Option<u32>,
    /// Pack the field unchanged. By default, it is first simplified, if it is of the kind that is fitted: refined to
    /// its own pictures, without leaves of little weight, and with smoother colors.
    #[arg(long)]
    exact: bool,
    /// Record the color histograms of the field in the file, so that hulls and fits that are extracted from the packed
    /// field are exactly those of the field, tones are near them, and nothing is sampled.
    #[arg(long, conflicts_with = "npz")]
    pub record_histograms: bool,
    /// Write the quantized .npz layout of volrend instead; requires --out.
    #[arg(long, requires = "out")]
    pub npz: bool,
    /// The views to measure.
    #[command(flatten)]
    pub views: ViewArguments,
    /// Also print the size of every section of the packed file.
    #[arg(long, conflicts_with = "npz")]
    pub verbose: bool,
}

/// The views in which packed fields are measured.
#[derive(Args)]
pub struct ViewArguments {
    /// A transforms.json file (NeRF, nerfstudio) in the field's coordinates, with the views to measure; by default,
    /// views from around the field.
    #[arg(long)]
    pub cameras: Option<PathBuf>,
    /// Size of the measured views in pixels; by default 200x200, or the size in --cameras.
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub size: Option<(u32, u32)>,
    /// The number of views to measure; 0 for none.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub views: u32,
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
    /// Returns how fields are packed.
    pub fn settings(self) -> PackSettings {
        match self {
            Self::Small => PackSettings::SMALL,
            Self::Balanced => PackSettings::BALANCED,
            Self::Fine => PackSettings::FINE,
        }
    }

    /// Returns how fields are simplified before.
    pub fn simplification(self) -> SimplifySettings {
        let (smoothness, evenness) = match self {
            Self::Small => (2e-4, 4e-5),
            Self::Balanced => (4e-5, 4e-5),
            Self::Fine => (1e-5, 1e-5),
        };
        SimplifySettings { smoothness, evenness, ..Default::default() }
    }

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
    /// Checks that all files can be written.
    pub fn check(&self) -> Result {
        let outputs: Vec<PathBuf> = self.fields.iter().map(|field| self.out(field)).collect::<Result<_>>()?;
        let [outputs, fields] =
            [&outputs, &self.fields].map(|paths| paths.iter().map(PathBuf::as_path).collect::<Vec<_>>());
        files::check_outputs(&outputs, &fields)
    }

    /// Returns the path of a field's packed file.
    pub fn out(&self, field: &Path) -> Result<PathBuf> {
        match &self.out {
            Some(_) if self.fields.len() > 1 => {
                Err("--out names one file, but there are several fields; without it, each is packed next to its field"
                    .into())
            }
            Some(out) if out.extension() != Some(if self.npz { "npz" } else { "plenoctree" }.as_ref()) => {
                let expected = match (self.npz, out.extension().is_some_and(|extension| extension == "npz")) {
                    (true, _) => "with --npz, expected a file that ends in .npz",
                    (false, true) => "expected --npz, too",
                    (false, false) => "expected a file that ends in .plenoctree",
                };
                Err(format!("found --out {}, {expected}", out.display()).into())
            }
            Some(out) => Ok(out.clone()),
            None => Ok(field.with_extension("plenoctree")),
        }
    }

    /// Returns how fields are simplified, or `None` if they are to be packed as they are.
    pub fn simplification(&self) -> Option<SimplifySettings> {
        // Leaves that nobody sees are among those that would go.
        let is_exact = self.exact || self.settings().hidden == 0.0;
        (!is_exact).then(|| self.quality.simplification())
    }

    /// Returns the settings of the quality, with those that were given.
    pub fn settings(&self) -> PackSettings {
        let settings = self.quality.settings();
        PackSettings {
            hidden: self.hidden.unwrap_or(settings.hidden),
            below: self.below.unwrap_or(settings.below),
            rows: self.rows.unwrap_or(settings.rows),
            record_histograms: self.record_histograms,
            ..settings
        }
    }
}
