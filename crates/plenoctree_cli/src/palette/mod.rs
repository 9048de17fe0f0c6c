//! `palette`: extracts a field's palette.

mod arguments;

pub use arguments::Arguments;

use crate::{Result, extraction, field, files, swatches};

/// Extracts, writes and prints the palette.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.field;
    let field = field::load(path, false)?;
    let extracted = extraction::extract(&field, path, &arguments.extraction, Some(arguments.sampling), false)?;
    let palette = &extracted.extraction.palette;

    let out = arguments.out();
    palette.write(&out)?;
    if let Some(image) = &arguments.image {
        files::write_image(image, &swatches::draw(palette))?;
    }
    print!("{}", swatches::lines(palette));
    println!("{} colors of {} saved to {}", palette.colors.len(), path.display(), out.display());
    Ok(())
}
