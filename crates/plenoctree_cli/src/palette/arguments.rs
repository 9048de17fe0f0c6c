//! The arguments of `palette`.

use std::path::PathBuf;

use clap::Args;

use crate::extraction::{ExtractionArguments, Sampling};

/// Extracts the palette of a field.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz file.
    pub field: PathBuf,
    /// How the palette is extracted.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
    /// What samples the field's radiance.
    #[arg(long, value_enum, default_value_t = Sampling::Cpu)]
    pub sampling: Sampling,
    /// Where the palette goes; beside the field, as x.palette.json for x.npz, by default.
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// Where to write the palette as an image too.
    #[arg(long, value_name = "FILE.png")]
    pub image: Option<PathBuf>,
}

impl Arguments {
    /// The palette's file.
    pub fn out(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| self.field.with_extension("palette.json"))
    }
}
