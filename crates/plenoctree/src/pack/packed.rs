//! Packs a field.

use std::{io::Write, path::Path};

use half::f16;

use super::{
    PackSettings,
    codebook::{Book, Draft},
    colors, density,
    leaves::Leaves,
    metric::Metric,
};
use crate::{
    field::{Frame, PlenOctree, Tables, from_rgb},
    file::{Quantized, TooEven, WriteError, check_frame},
    lod::lost,
    sampling::{Canceled, InvalidSetting, Progress, Seen, Visibility, visibility},
    save::replace_file,
};

/// An error that occurs when packing a field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PackError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] InvalidSetting),
    /// [`Progress::cancel`] was called.
    #[error(transparent)]
    Canceled(#[from] Canceled),
    /// The cube of the field is not within the range of float32, in which props are placed.
    #[error("found {found:?}, expected a frame within the range of float32")]
    Frame {
        /// The field's frame.
        found: Frame,
    },
    /// The file would be too small for what it holds.
    #[error(transparent)]
    TooEven(#[from] TooEven),
    /// The field is so faint that nothing of it would be left.
    #[error(
        "no leaf adds an opacity of {hidden} to a ray from outside, so nothing is left to pack; choose a smaller `hidden`"
    )]
    Faint {
        /// [`PackSettings::hidden`].
        hidden: f32,
    },
}

/// A typical difference between the color of a leaf and the color behind it.
const CONTRAST: f32 = 0.16;
/// The opacity that rays side by side may lose with the leaves that are dropped, on average.
const MOST_LOST: f64 = 0.05;

/// A packed field: the content of a `.plenoctree` file.
#[derive(Clone, Debug)]
pub struct Packed {
    field: PlenOctree,
    bytes: Vec<u8>,
    sections: Vec<(&'static str, usize)>,
}

impl Packed {
    /// Packs a field, on all cores. The result does not depend on their number.
    ///
    /// A field with a million leaves takes about three minutes on two cores. Most of that time goes into measuring
    /// visibility and searching for rows.
    ///
    /// # Errors
    ///
    /// Returns an error if a setting is out of range, if the field's cube does not fit in float32, if nothing would be
    /// left of its leaves, if so much of a large field is the same that readers would reject the file, or if packing is
    /// canceled.
    pub fn new(field: &PlenOctree, settings: &PackSettings, progress: &Progress) -> Result<Self, PackError> {
        settings.validate()?;
        let found = field.frame();
        check_frame(["offset", "scale"], found).map_err(|_| PackError::Frame { found })?;
        let inside = settings.hidden == 0.0;
        let Visibility { leaves: mut seen, directions } = visibility(field, settings.below.into(), inside, progress)?;
        let hidden = least(field, &seen, settings.hidden);
        let kept = field.retain(|leaf| seen[leaf as usize].most >= hidden);
        seen.retain(|seen| seen.most >= hidden);
        if kept.leaves() == 0 && field.leaves() > 0 {
            return Err(PackError::Faint { hidden });
        }
        let metric = Metric::new(&directions, field.basis().functions());
        let recorded = match settings.record_histograms {
            true => field.clone().recording_histograms(progress)?.recorded().cloned(),
            false => field.recorded().cloned(),
        };
        let quantized = Quantized { recorded, ..quantize(&kept, seen, &metric, settings, progress)? };
        let (bytes, sections) = quantized.encode()?;
        Ok(Self { field: quantized.field(), bytes, sections })
    }

    /// Returns the content of the file.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the names of the file's sections and their sizes in bytes.
    pub fn sections(&self) -> &[(&'static str, usize)] {
        &self.sections
    }

    /// Returns the packed field, as it is read from the file.
    pub fn field(&self) -> &PlenOctree {
        &self.field
    }

    /// Writes the file. Replaces an existing one.
    ///
    /// The file is first written under another name in the same folder, so that it is never seen half-written.
    ///
    /// # Errors
    ///
    /// Returns an error if writing fails. An existing file is then unchanged.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        replace_file(path.as_ref(), |file| Ok(file.write_all(&self.bytes)?))
    }
}

/// Returns what a leaf must add to a ray to be kept: `hidden`, or a quarter of it, and so on, until all leaves that are
/// dropped together matter little: many faint ones can be a fog.
fn least(field: &PlenOctree, seen: &[Seen], hidden: f32) -> f32 {
    const QUARTERS: usize = 15;
    let least = |quarters: usize| hidden * 0.25f32.powi(quarters as i32);
    // The last bin has the leaves that are kept anyway, and those that no ray reaches, which are always dropped.
    let bin = |leaf: u32| {
        let most = seen[leaf as usize].most;
        if most == 0.0 { QUARTERS } else { (1..=QUARTERS).rev().find(|bin| most >= least(QUARTERS - bin)).unwrap_or(0) }
    };
    let lost = lost::<{ QUARTERS + 1 }>(field, bin);
    let enough = (0..QUARTERS).find(|quarters| lost[QUARTERS - 1 - quarters] <= MOST_LOST);
    enough.map_or(f32::from_bits(1), least)
}

/// Returns a step that is hardly smaller, such that no color in steps is on the border of two bins of a histogram. All
/// leaves with such a color would change bins by the least rounding, if their color is the same in all directions.
fn between_bins(step: f32) -> f32 {
    // In bins. Rounding moves colors by less.
    const NEAR: f64 = 2e-5;
    const TRIES: u32 = 64;
    let is_near = |step: f32| {
        let mut colors = (1..).map(|steps| f64::from(steps) * f64::from(step)).take_while(|color| *color < 1.0);
        colors.any(|color| (2..=64).map(|bins| color * f64::from(bins)).any(|at| (at - at.round()).abs() < NEAR))
    };
    let mut steps = (0..TRIES).map(|index| step * (1.0 - index as f32 / 4096.0));
    steps.find(|step| !is_near(*step)).unwrap_or(step)
}

fn quantize(
    field: &PlenOctree,
    mut seen: Vec<Seen>,
    metric: &Metric,
    settings: &PackSettings,
    progress: &Progress,
) -> Result<Quantized, Canceled> {
    let mean = normalize(&mut seen);
    let unit = settings.unit(field);
    // Opacity matters as much as the contrast between a leaf and what is behind it, in all channels.
    let slope = settings.slope(field);
    let opacity_bits = settings.bits(1.0) * 3.0 * CONTRAST * CONTRAST * slope * slope / mean;
    let (densities, levels) = density::quantize(field, &seen, settings.density_levels, opacity_bits, progress)?;
    let ([luma, chroma], table_step) = books(field, &seen, metric, settings, progress)?;
    let rows: Vec<[u16; 2]> = luma.rows.into_iter().zip(chroma.rows).map(|(luma, chroma)| [luma, chroma]).collect();
    let tables = Tables { color_step: 0.0, table_step, luma: luma.table, chroma: chroma.table };
    let colors = colors::corrected(field, &seen, metric, &rows, &tables);
    let has_directions = field.basis().functions() > 1;
    let color_step = settings.color_step.max(colors::least_step(&colors, unit));
    let color_step = if has_directions { color_step } else { between_bins(color_step) };
    let tables = Tables { color_step: color_step * unit, ..tables };
    let colors = colors::quantize(&colors, &seen, tables.color_step, settings.bits(color_step));
    Ok(Quantized {
        frame: field.frame(),
        basis: field.basis(),
        activation: field.activation(),
        up: field.up(),
        depth: field.depth(),
        nodes: field.nodes().to_vec(),
        densities,
        levels,
        colors,
        rows,
        tables,
        recorded: None,
    })
}

impl PlenOctree {
    /// Returns the field with the histograms that [`Self::histograms`] of `original` returns, if it has any.
    ///
    /// Use this for a field that was made from `original` and looks like it.
    pub fn with_histograms_of(self, original: &PlenOctree) -> Self {
        self.with_recorded(original.recorded().cloned())
    }
}

/// Builds the codebooks of luma and of the differences. Returns them and the step of their coefficients.
fn books(
    field: &PlenOctree,
    seen: &[Seen],
    metric: &Metric,
    settings: &PackSettings,
    progress: &Progress,
) -> Result<([Book; 2], f32), Canceled> {
    let (mut luma, mut chroma) = (Vec::new(), Vec::new());
    for leaf in 0..seen.len() {
        let colors = field.stored().of_functions(field.basis(), leaf);
        let parts = || colors[1..=metric.others()].iter().map(|color| from_rgb(color.map(f16::to_f32)));
        luma.extend(parts().map(|parts| parts[0]));
        chroma.extend(parts().map(|parts| parts[1]));
        chroma.extend(parts().map(|parts| parts[2]));
    }
    let unit = settings.unit(field);
    let scale = settings.bits(1.0 / unit);
    let leaves = |values, shares| Leaves { metric, seen, shares, values, scale };
    let rows = settings.rows as usize;
    let (luma, chroma) = (leaves(luma, &[1.0]), leaves(chroma, &[2.0 / 3.0, 1.0]));
    let drafts = [Draft::new(&luma, rows, progress)?, Draft::new(&chroma, rows.div_ceil(2), progress)?];
    let least = drafts.each_ref().map(|draft| draft.least_step(unit)).into_iter().fold(0.0, f32::max);
    let step = settings.table_step.max(least) * unit;
    let [of_luma, of_chroma] = drafts;
    Ok(([of_luma.finished(&luma, step, progress)?, of_chroma.finished(&chroma, step, progress)?], step))
}

/// Scales the weights of colors so that their mean over all leaves is 1, and those of channels the same. Returns the
/// previous mean.
fn normalize(seen: &mut [Seen]) -> f32 {
    let sum: f64 = seen.iter().flat_map(|seen| seen.colors).map(f64::from).sum();
    let mean = sum / (3 * seen.len()).max(1) as f64;
    if mean > 0.0 {
        let scaled = |weight: f32| (f64::from(weight) / mean) as f32;
        for seen in seen {
            (seen.channels, seen.colors) = (seen.channels.map(scaled), seen.colors.map(scaled));
        }
    }
    mean.max(f64::from(f32::MIN_POSITIVE)) as f32
}
