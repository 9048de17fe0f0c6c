//! Renders the frames of a turn in all the versions to compare.

use image::{DynamicImage, RgbImage, RgbaImage};
use indicatif::ProgressBar;
use plenoctree::{
    LABEL_OPACITY,
    camera::PinholeCamera,
    palette::{Palette, simplify_hull},
};
use plenoctree_cli::{
    hex,
    renderer::{Look, PosterizeSettings, Render},
    result::Result,
};

use super::series::{Column, Series};
use crate::recolor::opposite_hues;

/// A palette of the whole field.
pub struct FieldPalette<'a> {
    /// Its name in files.
    pub name: &'a str,
    /// Its name for readers.
    pub label: &'a str,
    /// The palette.
    pub palette: &'a Palette,
}

/// Compares neighboring frames as trained, posterized with each of the field's palettes, and posterized with their own
/// palettes of at most `colors` colors; the posterized ones also recolored.
pub fn compare(
    renderer: &mut dyn Render,
    cameras: &[PinholeCamera],
    palettes: &[FieldPalette],
    colors: usize,
    bar: &ProgressBar,
) -> Result<Series> {
    let mut series = Series::new(columns(palettes));
    for (frame, camera) in cameras.iter().enumerate() {
        let images = versions(renderer, camera, palettes, colors).map_err(|error| format!("frame {frame}: {error}"))?;
        series.push(images);
        bar.inc(1);
    }
    Ok(series)
}

fn columns(palettes: &[FieldPalette]) -> Vec<Column> {
    let column = |name: String, label: String, color, recolored| {
        let differences = Vec::new();
        Column { name, label, color, recolored, differences }
    };
    let mut columns = vec![column("plain".into(), "as trained".into(), 0, false)];
    let own = FieldLabel { name: "per_frame", label: "frame's palette" };
    let fields = palettes.iter().map(|palette| FieldLabel { name: palette.name, label: palette.label });
    for (index, FieldLabel { name, label }) in fields.chain([own]).enumerate() {
        columns.push(column(name.into(), label.into(), index + 1, false));
        columns.push(column(format!("{name}_recolored"), format!("{label}, recolored"), index + 1, true));
    }
    columns
}

struct FieldLabel<'a> {
    name: &'a str,
    label: &'a str,
}

/// Renders a view in the order of [`columns`].
fn versions(
    renderer: &mut dyn Render,
    camera: &PinholeCamera,
    palettes: &[FieldPalette],
    colors: usize,
) -> Result<Vec<RgbImage>> {
    let settings = PosterizeSettings::default();
    let original = renderer.original(camera)?;
    let own = palette_of_frame(&original, colors)?;
    let mut images = vec![DynamicImage::from(original).into_rgb8()];
    for palette in palettes.iter().map(|palette| palette.palette).chain([&own]) {
        let source = &palette.colors;
        for shown in [source, &opposite_hues(source)] {
            images.push(renderer.posterized(camera, &Look { palette, shown, settings })?.0);
        }
    }
    Ok(images)
}

/// Returns the palette of one frame: the simplified convex hull of the pixels that are posterized (Tan et al. 2016).
pub fn palette_of_frame(original: &RgbaImage, colors: usize) -> Result<Palette> {
    let pixels = object_pixels(original);
    if pixels.is_empty() {
        return Err("no pixel is opaque enough to be posterized".into());
    }
    Ok(simplify_hull(&pixels, colors)?)
}

/// Returns the colors of the pixels that are posterized, in encoded sRGB from 0 to 1.
pub fn object_pixels(original: &RgbaImage) -> Vec<[f64; 3]> {
    let pixels = original.pixels().map(|pixel| hex::unit(pixel.0)).filter(|[.., opacity]| *opacity >= LABEL_OPACITY);
    pixels.map(|[r, g, b, _]| [r, g, b]).collect()
}
