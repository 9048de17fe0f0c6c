//! `steady`: measures how many labels and lines flicker while the camera turns around a field.
//!
//! Every pixel of a frame is compared with where the former frame saw the same point of the field, which rays in
//! float64 tell. What the former frame did not see does not count.
//!
//! | column | |
//! |---|---|
//! | `changed` | percent of pixels whose label is not that of the former frame |
//! | `flicker` | percent whose label the former frame had nowhere within a pixel |
//! | `error` | mean distance of colors as trained to their labels, in Oklab |
//! | `shown` | percent whose color, with smooth borders, differs by more than 8 of 255 from all colors within a pixel |
//! | `lines` | pixels of lines per frame: those that ink darkens to less than half of their light |
//! | `lost`, `new` | percent of them that the next or the former frame has nowhere within a pixel |

mod arguments;
mod seen;
mod stage;

pub use arguments::Arguments;

use image::RgbaImage;
use indicatif::ProgressBar;
use plenoctree::palette::{ExtractionSettings, Palette, tone_space};
use plenoctree_cli::{
    console, extraction, field, hex, progress,
    result::Result,
    turntable::{ELEVATION, START, around},
};

use self::{
    seen::{Pair, Seen},
    stage::{Kind, Stage},
};

/// Draws the frames, compares them, and prints a table.
pub fn run(arguments: &Arguments) -> Result {
    let path = &field::or_default(arguments.field.as_deref());
    let named = |error: Box<dyn std::error::Error>| format!("{}: {error}", path.display());
    let field = field::load(path, arguments.quiet)?;
    let extracted = extraction::cpu::extract(&field, &ExtractionSettings::default(), arguments.quiet).map_err(named)?;
    let palette = extracted.extraction.palette;
    let azimuths = (0..arguments.frames).map(|frame| START + (f64::from(frame) * arguments.turn).to_radians());
    let cameras = around(&field, arguments.size, azimuths, ELEVATION)
        .ok_or_else(|| format!("{}: the field is empty", path.display()))?;
    let bar = progress::bar("casting rays", cameras.len() as u64, arguments.quiet);
    let seen: Vec<_> = cameras
        .iter()
        .map(|camera| {
            bar.inc(1);
            Seen::new(&field, camera)
        })
        .collect();
    bar.finish_and_clear();
    let pairs: Vec<_> = seen.windows(2).map(|two| Pair::new(&two[0], &two[1])).collect();

    let mut stage = Stage::new(&field, &palette, arguments)?;
    let mut draw = |steadiness, kind, bar: &ProgressBar| -> Result<Vec<RgbaImage>> {
        stage.set(steadiness, kind);
        bar.inc(1);
        cameras.iter().map(|camera| stage.capture(camera)).collect()
    };
    let mut text = format!(
        "{:>10} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n",
        "steadiness", "changed", "flicker", "error", "shown", "lines", "lost", "new"
    );
    let bar = progress::bar("drawing", 4 * arguments.steadiness.len() as u64, arguments.quiet);
    for steadiness in &arguments.steadiness {
        let labels: Vec<_> =
            draw(*steadiness, Kind::Labels, &bar)?.iter().map(|frame| labels(frame, &palette)).collect();
        let plain = draw(*steadiness, Kind::Shown, &bar)?;
        let inked = draw(*steadiness, Kind::Inked, &bar)?;
        let lines: Vec<_> = plain.iter().zip(&inked).map(|(plain, inked)| lines(plain, inked)).collect();
        let count = lines.iter().flatten().filter(|line| **line).count() as f64 / lines.len() as f64;
        let [mut changed, mut flicker, mut shown, mut lost, mut new] = [Share::default(); 5];
        for (index, pair) in pairs.iter().enumerate() {
            let [before, after] = [&labels[index], &labels[index + 1]];
            for (now, then) in pair.forward() {
                if let (Some(label), Some(_)) = (after[now], before[then]) {
                    changed.add(before[then] != Some(label));
                    flicker.add(!pair.around(then).any(|there| before[there] == Some(label)));
                    let [former, next] = [index, index + 1].map(|frame| plain[frame].as_raw());
                    let differs = |there: usize| {
                        (0..3).any(|channel| former[4 * there + channel].abs_diff(next[4 * now + channel]) > 8)
                    };
                    shown.add(pair.around(then).all(differs));
                }
                if lines[index + 1][now] {
                    new.add(!pair.around(then).any(|there| lines[index][there]));
                }
            }
            for (then, now) in pair.backward() {
                if lines[index][then] {
                    lost.add(!pair.around(now).any(|there| lines[index + 1][there]));
                }
            }
        }
        let error = error(&seen, &labels, &palette);
        text += &format!(
            "{steadiness:10} {:8.2} {:8.2} {error:8.5} {:8.2} {count:8.0} {:8.2} {:8.2}\n",
            changed.percent(),
            flicker.percent(),
            shown.percent(),
            lost.percent(),
            new.percent()
        );
    }
    bar.finish_and_clear();
    console::print(&text);
    Ok(())
}

/// Counts how often something holds.
#[derive(Clone, Copy, Default)]
struct Share {
    all: usize,
    of: usize,
}

impl Share {
    fn add(&mut self, holds: bool) {
        self.all += 1;
        self.of += usize::from(holds);
    }

    fn percent(self) -> f64 {
        100.0 * self.of as f64 / self.all.max(1) as f64
    }
}

/// Returns the labels of a frame that shows their codes.
fn labels(frame: &RgbaImage, palette: &Palette) -> Vec<Option<usize>> {
    frame.pixels().map(|pixel| stage::label_of(pixel, palette.colors.len())).collect()
}

/// Returns which pixels have lines.
fn lines(plain: &RgbaImage, inked: &RgbaImage) -> Vec<bool> {
    let light = |pixel: &image::Rgba<u8>| -> f64 {
        let [r, g, b, _] = hex::unit(pixel.0);
        [r, g, b].map(|channel| channel.powf(2.2)).iter().sum()
    };
    plain.pixels().zip(inked.pixels()).map(|(plain, inked)| light(inked) < 0.5 * light(plain)).collect()
}

/// Returns the mean distance of colors as trained to their labels.
fn error(seen: &[Seen], labels: &[Vec<Option<usize>>], palette: &Palette) -> f64 {
    let tones: Vec<_> = palette.colors.iter().map(|color| tone_space((*color).into())).collect();
    let (mut sum, mut count) = (0.0, 0usize);
    for (seen, labels) in seen.iter().zip(labels) {
        for (hit, label) in seen.hits.iter().zip(labels) {
            if let (Some(hit), Some(label)) = (hit, label) {
                sum += tone_space(hit.color).distance(tones[*label]);
                count += 1;
            }
        }
    }
    sum / count.max(1) as f64
}
