//! `coherence`: compares how coherent an animation is with one palette for the field, and with one palette for each
//! frame. This is figure 7 of the paper.
//!
//! The camera turns by 90 degrees around the field. Every frame is drawn as trained, posterized with the field's
//! palette, and posterized with a palette of its own, the simplified convex hull of its pixels (Tan et al. 2016). The
//! posterized frames are also recolored: every palette color gets the opposite hue. `coherence.csv` lists how much
//! neighboring frames differ, and `coherence.png` plots it:
//!
//! | column | |
//! |---|---|
//! | `frame` | the second frame of the pair, counted from 0 |
//! | `plain` | mean absolute difference of encoded sRGB, in [0, 1], over all pixels and channels, as trained |
//! | `field`, `per_frame` | the same for frames that are posterized with the field's palette, and with their own |
//! | `field_recolored`, `per_frame_recolored` | the same for frames that are also recolored |

mod arguments;
mod plot;
mod series;
mod stage;
mod turn;

pub use arguments::Arguments;

use plenoctree::palette::ExtractionSettings;

use crate::{Result, extraction, field, files, progress};
use series::Series;
use stage::Stage;

/// Renders the frames, compares them, and writes the table and the plot.
pub fn run(arguments: &Arguments) -> Result {
    let path = &field::or_default(arguments.field.as_deref());
    let named = |error: Box<dyn std::error::Error>| format!("{}: {error}", path.display());
    let field = field::load(path, arguments.quiet)?;
    let extracted = extraction::cpu::extract(&field, &ExtractionSettings::default(), arguments.quiet).map_err(named)?;
    let cameras = turn::quarter(&field, arguments.size, arguments.frames as usize)
        .ok_or_else(|| format!("{}: the field is empty", path.display()))?;
    let out = &arguments.out;
    files::create_folder(out)?;

    let mut stage = Stage::new(field, extracted.extraction.palette, arguments.size).map_err(named)?;
    let mut series = Series::default();
    let bar = progress::bar("rendering", cameras.len() as u64, arguments.quiet);
    for (frame, camera) in cameras.iter().enumerate() {
        series.push(stage.capture(camera).map_err(|error| format!("frame {frame}: {error}"))?);
        bar.inc(1);
    }
    bar.finish_and_clear();

    series.write(&out.join("coherence.csv"))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    files::write_image(&out.join("coherence.png"), &plot::draw(&series, &name))?;
    if !arguments.quiet {
        print!("{}", series.summary());
        println!("{} frames of {} compared, results saved to {}", cameras.len(), path.display(), out.display());
    }
    Ok(())
}
