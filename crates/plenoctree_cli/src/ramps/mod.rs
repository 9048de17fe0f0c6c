//! `ramps`: lists and edits the ramps of a palette.

mod arguments;
mod edit;

pub use arguments::Arguments;

use std::path::{Path, PathBuf};

use plenoctree::palette::Palette;

use crate::{console, files, result::Result, swatches};

/// Edits the ramps, writes the palette if they changed, and prints them.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.palette;
    if let Some(out) = arguments.out.as_ref().filter(|out| out.extension().is_none_or(|extension| extension != "json"))
    {
        return Err(format!("{}: the name of the palette must end in .json", out.display()).into());
    }
    let mut palette = Palette::read(path)?;
    if let Some(image) = &arguments.image {
        files::check_image(image)?;
        files::check_outputs(&[image], &[path])?;
    }
    let out = (!arguments.edits.is_empty()).then(|| arguments.out.as_ref().unwrap_or(path));
    let outputs: Vec<&Path> = arguments.image.iter().chain(out).map(PathBuf::as_path).collect();
    files::check_outputs(&outputs, &[])?;
    for edit in &arguments.edits {
        edit.apply(&mut palette).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    if let Some(out) = out {
        files::keep_former_palette(out, Some(&palette))?;
        palette.write(out)?;
    }
    if let Some(image) = &arguments.image {
        files::write_image(image, &swatches::draw(&palette))?;
    }
    console::print(&swatches::lines(&palette));
    Ok(())
}
