//! Writes the results of a fit. Files are complete before they replace others.

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::RgbImage;
use plenoctree::{PlenOctree, fit::Comparison, palette::Palette};
use serde_json::Value;

use crate::{files, result::Result};

/// Checks that the output can be written, before the work starts.
pub fn check(out: &Path) -> Result {
    if out.extension().is_none_or(|extension| extension != "npz") {
        return Err(format!("{}: found another extension, expected .npz", out.display()).into());
    }
    let folder = folder(out);
    files::create_folder(&folder)?;
    let probe = partial(out);
    fs::write(&probe, [])
        .and_then(|()| fs::remove_file(&probe))
        .map_err(|error| format!("{}: cannot be written: {error}", out.display()).into())
}

/// Writes the field, its palette, previews of the held-out views, and the report.
pub fn write(out: &Path, field: &PlenOctree, palette: &Palette, previews: &[Comparison], report: &Value) -> Result {
    let views = out.with_extension("views");
    let targets = [out.to_path_buf(), out.with_extension("palette.json"), folder(out).join("report.json")];
    field.write(partial(&targets[0])).map_err(|error| format!("{}: {error}", out.display()))?;
    palette.write(partial(&targets[1]))?;
    files::write_text(&partial(&targets[2]), &(serde_json::to_string_pretty(report)? + "\n"))?;
    if !previews.is_empty() {
        let unfinished = partial(&views);
        let _ = fs::remove_dir_all(&unfinished);
        files::create_folder(&unfinished)?;
        for preview in previews {
            let name: String =
                preview.name.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '-' }).collect();
            let path = unfinished.join(format!("{}.png", name.trim_matches('-')));
            files::write_image(&path, &side_by_side(preview))?;
        }
        let _ = fs::remove_dir_all(&views);
        rename(&unfinished, &views)?;
    }
    targets.iter().try_for_each(|target| rename(&partial(target), target))
}

/// Draws the photograph at the left and the field at the right.
fn side_by_side(preview: &Comparison) -> RgbImage {
    RgbImage::from_fn(2 * preview.width, preview.height, |x, y| {
        let (pixels, x) = match x.checked_sub(preview.width) {
            None => (&preview.photographed, x),
            Some(x) => (&preview.rendered, x),
        };
        image::Rgb(pixels[(y * preview.width + x) as usize])
    })
}

fn folder(out: &Path) -> PathBuf {
    out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).into()
}

/// Returns the temporary name of an incomplete file.
fn partial(path: &Path) -> PathBuf {
    path.with_added_extension("partial")
}

fn rename(from: &Path, to: &Path) -> Result {
    Ok(fs::rename(from, to).map_err(|error| format!("{}: {error}", to.display()))?)
}
