//! `palette`: extracts a field's palette.

mod arguments;

pub use arguments::Arguments;

use plenoctree::{palette::extract_from_histograms, sampling::Progress};

use crate::{
    extraction::{self, histograms},
    field, files,
    result::Result,
    swatches,
};
use arguments::Input;

/// Extracts, writes and prints the palette.
pub fn run(arguments: &Arguments) -> Result {
    let (path, extraction) = match arguments.input() {
        Input::Field(path) => {
            let field = field::load(path, false)?;
            let sampling = Some(arguments.sampling);
            (path, extraction::extract(&field, path, &arguments.extraction, sampling, false)?.extraction)
        }
        Input::Histograms(path) => {
            let extracted = extract_from_histograms(
                &histograms::read(path)?,
                &arguments.extraction.settings(),
                &Progress::default(),
            );
            (path, extracted.map_err(|error| format!("{}: {error}", path.display()))?)
        }
    };
    let palette = &extraction.palette;

    let out = arguments.out(path);
    palette.write(&out)?;
    if let Some(image) = &arguments.image {
        files::write_image(image, &swatches::draw(palette))?;
    }
    print!("{}", swatches::lines(palette));
    let errors = extraction.errors;
    println!("error to the nearest label: {:.2} of 255; hue off: {:.1}%", 255.0 * errors.rmse, 100.0 * errors.hue);
    println!("{} colors of {} saved to {}", palette.colors.len(), path.display(), out.display());
    Ok(())
}
