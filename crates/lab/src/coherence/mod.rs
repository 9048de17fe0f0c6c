//! `coherence`: compares how coherent an animation is with one palette for the field, and with one palette for each
//! frame. This is figure 7 of the paper.
//!
//! The camera turns by 90 degrees around the field. Every frame is drawn as trained, posterized with the field's
//! palette, and posterized with its own palette, the simplified convex hull of its pixels (Tan et al. 2016). The
//! posterized frames are also recolored: every palette color gets the opposite hue. `coherence.csv` lists how much
//! neighboring frames differ, and `coherence.svg` plots it:
//!
//! | column | |
//! |---|---|
//! | `frame` | the second frame of the pair, counted from 0 |
//! | `plain` | mean absolute difference of encoded sRGB, in [0, 1], over all pixels and channels, as trained |
//! | `field`, `per_frame` | the same for frames that are posterized with the field's palette, and with their own |
//! | `field_recolored`, `per_frame_recolored` | the same for frames that are also recolored |

mod arguments;
mod compare;
mod series;
mod turn;

pub use arguments::Arguments;
pub use compare::{FieldPalette, compare, object_pixels, palette_of_frame};
pub use series::{Series, mean_difference};
pub use turn::quarter;

use plenoctree::palette::{ExtractionSettings, PaletteMethod};
use plenoctree_cli::{console, extraction, field, files, preset::Preset, progress, renderer::Scene, result::Result};

/// Renders the frames, compares them, and writes the table and the plot.
pub fn run(arguments: &Arguments) -> Result {
    let path = &field::or_default(arguments.field.as_deref());
    let named = |error: Box<dyn std::error::Error>| format!("{}: {error}", path.display());
    let field = field::load(path, arguments.quiet)?;
    let out = &arguments.out;
    files::create_folder(out)?;
    let settings = ExtractionSettings { method: PaletteMethod::Fitted, ..ExtractionSettings::default() };
    let extracted = extraction::cpu::extract(&field, &settings, arguments.quiet).map_err(named)?;
    let cameras = quarter(&field, arguments.size, arguments.frames as usize)
        .ok_or_else(|| format!("{}: the field is empty", path.display()))?;
    let scene = Scene { field, quality: Preset::Exact, background: [255; 3] };
    let mut renderer = arguments.renderer.start(scene, &cameras).map_err(named)?;
    let palette = &extracted.extraction.palette;
    let palettes = [FieldPalette { name: "field", label: "field's palette", palette }];
    let bar = progress::bar("rendering", cameras.len() as u64, arguments.quiet);
    let series = compare(&mut *renderer, &cameras, &palettes, palette.colors.len(), &bar).map_err(named)?;
    bar.finish_and_clear();

    let name = path.file_name().unwrap_or_default().to_string_lossy();
    files::write_text(&out.join("coherence.csv"), &series.csv())?;
    files::write_text(&out.join("coherence.svg"), &series.svg(&name))?;
    if !arguments.quiet {
        console::print(&summary(&series));
        console::say!("{} frames of {} compared, results saved to {}", cameras.len(), path.display(), out.display());
    }
    Ok(())
}

/// Returns a table of means, worst differences and spikes.
fn summary(series: &Series) -> String {
    let mut text = format!("{:20} {:>8} {:>8} {:>8}\n", "", "mean", "worst", "spikes");
    for column in &series.columns {
        let (frame, worst) = column.worst();
        let (name, mean, spikes) = (&column.name, column.mean(), series.spikes(column));
        text += &format!("{name:20} {mean:8.5} {worst:8.5} {spikes:8} (worst at frame {frame})\n");
    }
    text
}
