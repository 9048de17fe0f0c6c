//! `packing`: packs fields with every quality, and compares size, accuracy and changed labels.

mod report;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use plenoctree_cli::{
    field::FieldArguments,
    files,
    pack::{Quality, ViewArguments, Views, pack},
    result::Result,
};

/// Pack fields with every quality, and write a table and plots of size, accuracy and changed labels.
#[derive(Args)]
pub struct Arguments {
    /// The fields: .npz files.
    #[arg(required = true)]
    fields: Vec<PathBuf>,
    /// How to read the fields.
    #[command(flatten)]
    reading: FieldArguments,
    /// The folder for the table and the plots.
    #[arg(long)]
    out: PathBuf,
    /// The views to measure.
    #[command(flatten)]
    views: ViewArguments,
}

/// Packs and measures the fields.
pub fn run(arguments: &Arguments) -> Result {
    if arguments.views.views == 0 {
        return Err("found --views 0, expected --views 1 or more".into());
    }
    files::create_folder(&arguments.out)?;
    let fields: Result<Vec<_>> = arguments.fields.iter().map(|path| measure(path, arguments)).collect();
    report::write(&arguments.out, &fields?)
}

fn measure(path: &Path, arguments: &Arguments) -> Result<report::Field> {
    let before = files::size(path)?;
    let field = arguments.reading.load(path, false)?;
    let views = Views::new(&field, path, &arguments.views)?.filter(|views| views.palette().is_some());
    let views = views.ok_or_else(|| {
        format!("{}: found nothing to measure, expected a field with a palette, and views", path.display())
    })?;
    let row = |quality: &Quality| {
        let packed = pack(&field, path, &quality.settings(), Some(quality.simplification()))?;
        Ok(report::Row::new(*quality, field.leaves(), &packed, &views))
    };
    let name = path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let rows: Result<_> = Quality::value_variants().iter().map(row).collect();
    Ok(report::Field { name, before, rows: rows? })
}
