//! `palette`: extracts a field's palette.

mod arguments;

pub use arguments::Arguments;

use std::path::Path;

use plenoctree::{
    palette::{Extraction, extract_from_samples},
    sampling::{Histograms, Progress},
};

use crate::{console, extraction, files, number::counted, result::Result, swatches};

/// Extracts, writes and prints the palette.
pub fn run(arguments: &Arguments) -> Result {
    let settings = arguments.extraction.settings()?;
    let (path, holds_histograms) = arguments.input();
    let out = arguments.out(path);
    arguments.check_outputs(&out, path)?;
    let extraction = if holds_histograms {
        let extracted = extract_from_samples(&Histograms::read(path)?, &[], &settings, &Progress::default());
        let extraction = extracted.map_err(|error| format!("{}: {error}", path.display()))?;
        extraction::warn_of_error(path, &settings, &extraction);
        extraction
    } else {
        let field = arguments.reading.load(path, arguments.quiet)?;
        let sampling = Some(arguments.sampling);
        extraction::extract(&field, path, &arguments.extraction, sampling, arguments.quiet)?.extraction
    };
    let palette = &extraction.palette;
    files::keep_former_palette(&out, Some(palette))?;
    palette.write(&out)?;
    if let Some(image) = &arguments.image {
        files::write_image(image, &swatches::draw(palette))?;
    }
    if !arguments.quiet {
        report(path, &out, &extraction);
    }
    Ok(())
}

/// Prints the palette that was extracted from the file `path` and saved to `out`, and how near it comes to the field.
fn report(path: &Path, out: &Path, extraction: &Extraction) {
    let palette = &extraction.palette;
    console::print(&swatches::lines(palette));
    let errors = extraction.report.errors;
    console::say!(
        "shown with these colors, a channel of the field is off by {:.2} of 255 (root mean square), and {:.1}% of what is \
         colorful gets another hue",
        255.0 * errors.rmse,
        100.0 * errors.hue
    );
    let colors = counted(palette.colors.len(), "color", "colors");
    console::say!("{colors} of {} saved to {}", path.display(), out.display());
}
