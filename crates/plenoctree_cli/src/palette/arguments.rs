//! The arguments of `palette`.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::{
    extraction::{ExtractionArguments, Sampling},
    field::FieldArguments,
    files,
    result::Result,
};

/// Extract the palette of a field.
#[derive(Args)]
pub struct Arguments {
    /// The field, an .npz or .plenoctree file.
    #[command(flatten)]
    source: Source,
    /// How to read the field.
    #[command(flatten)]
    pub reading: FieldArguments,
    /// The arguments for extraction.
    #[command(flatten)]
    pub extraction: ExtractionArguments,
    /// The sampler of the field's radiance.
    #[arg(long, value_enum, default_value_t = Sampling::Cpu)]
    pub sampling: Sampling,
    /// The file to save the palette to; by default next to the input, as x.palette.json for x.npz. Another palette that
    /// is there is kept as x.palette.json.old.
    #[arg(long, value_name = "FILE.json")]
    out: Option<PathBuf>,
    /// The file to save an image of the palette to.
    #[arg(long, value_name = "FILE.png")]
    pub image: Option<PathBuf>,
    /// Print only warnings and errors.
    #[arg(long)]
    pub quiet: bool,
}

/// The input of palette extraction.
#[derive(Args)]
#[group(required = true, multiple = false)]
struct Source {
    /// The field, an .npz or .plenoctree file.
    field: Option<PathBuf>,
    /// Histograms to use instead of a field, as saved by --histograms.
    #[arg(long, value_name = "FILE.npz", conflicts_with_all = [
        "sampling", "sample_fraction", "histograms", "activation", "up",
    ])]
    from_histograms: Option<PathBuf>,
}

impl Arguments {
    /// Checks that the files can be written: the palette to `out`, its image and the histograms.
    pub fn check_outputs(&self, out: &Path, input: &Path) -> Result {
        self.image.iter().try_for_each(|image| files::check_image(image))?;
        let others = [&self.image, &self.extraction.histograms].into_iter().flatten().map(PathBuf::as_path);
        files::check_outputs(&[out].into_iter().chain(others).collect::<Vec<_>>(), &[input])
    }

    /// Returns the file that the palette is extracted from, and whether it holds histograms instead of a field.
    pub fn input(&self) -> (&Path, bool) {
        let Source { field, from_histograms } = &self.source;
        let path = from_histograms.as_deref().or(field.as_deref()).unwrap_or(Path::new(""));
        (path, from_histograms.is_some())
    }

    /// Returns the file to save the palette to. `input` is the file that the palette is extracted from.
    pub fn out(&self, input: &Path) -> PathBuf {
        self.out.clone().unwrap_or_else(|| input.with_extension("palette.json"))
    }
}
