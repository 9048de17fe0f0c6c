//! The arguments of `palette`.

use std::path::PathBuf;

use clap::Args;

use crate::extraction::{ExtractionArguments, Sampling};

/// Extracts the palette of a field.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz file.
    pub field: PathBuf,
    /// The arguments for extraction.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
    /// The sampler of the field's radiance.
    #[arg(long, value_enum, default_value_t = Sampling::Cpu)]
    pub sampling: Sampling,
    /// The file to save the palette to; by default next to the field, as x.palette.json for x.npz.
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// The file to save an image of the palette to.
    #[arg(long, value_name = "FILE.png")]
    pub image: Option<PathBuf>,
}

impl Arguments {
    /// Returns the file to save the palette to.
    pub fn out(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| self.field.with_extension("palette.json"))
    }
}
