//! Packs a field.

use std::{io::Write, path::Path};

use super::{PackSettings, Quantized, codebook, colors, density};
use crate::{
    field::{Frame, InvalidField, PlenOctree},
    file::{WriteError, check_frame},
    sampling::{Canceled, InvalidSetting, Progress, Seen, visibility},
    save::save,
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
    /// The rounded numbers do not form a field.
    #[error(transparent)]
    Field(#[from] InvalidField),
}

/// A packed field: the content of a `.plenoctree` file.
#[derive(Clone, Debug)]
pub struct Packed {
    field: PlenOctree,
    bytes: Vec<u8>,
    sections: Vec<(&'static str, usize)>,
    dropped: usize,
}

impl Packed {
    /// Packs a field, on all cores. The result does not depend on their number.
    ///
    /// A field with a million leaves takes about a minute on two cores. Most of it is the search for the codebook.
    ///
    /// # Errors
    ///
    /// Returns an error if a setting is out of range, if the field's cube does not fit in float32, or if packing is
    /// canceled.
    pub fn new(field: &PlenOctree, settings: &PackSettings, progress: &Progress) -> Result<Self, PackError> {
        settings.validate()?;
        let found = field.frame();
        check_frame(["offset", "scale"], found).map_err(|_| PackError::Frame { found })?;
        let seen = visibility(field, progress)?;
        let keep = |leaf: u32| settings.hidden == 0.0 || seen[leaf as usize].most >= settings.hidden;
        let kept = field.retain(keep);
        let seen: Vec<Seen> = (0..).zip(&seen).filter(|(leaf, _)| keep(*leaf)).map(|(_, seen)| seen.clone()).collect();
        let quantized = quantize(&kept, seen, settings, progress)?;
        let (bytes, sections) = quantized.encode();
        let dropped = field.leaves() - kept.leaves();
        Ok(Self { field: quantized.field()?, bytes, sections, dropped })
    }

    /// Returns the content of the file.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the names of the file's sections and their sizes in bytes.
    pub fn sections(&self) -> &[(&'static str, usize)] {
        &self.sections
    }

    /// Returns the number of leaves that were dropped, because nobody sees them.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// Returns the packed field, as it is read from the file.
    pub fn field(&self) -> &PlenOctree {
        &self.field
    }

    /// Writes the file. Replaces an existing one.
    ///
    /// The file is first written under another name in the same folder, so that nobody reads half of it.
    ///
    /// # Errors
    ///
    /// Returns an error if writing fails. An existing file is then unchanged.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        save(path.as_ref(), |file| Ok(file.write_all(&self.bytes)?))
    }
}

fn quantize(
    field: &PlenOctree,
    mut seen: Vec<Seen>,
    settings: &PackSettings,
    progress: &Progress,
) -> Result<Quantized, Canceled> {
    normalize(&mut seen);
    let (densities, levels) = density::quantize(field, &seen, settings.density_levels);
    let unit = settings.unit(field);
    let (step, table_step) = (settings.color_step * unit, settings.table_step * unit);
    let book = codebook::build(field, &seen, settings, progress)?;
    let (table, table_step) = codebook::whole(&book.table, table_step);
    let constants = colors::corrected(field, &seen, &book.rows, &table, table_step);
    let constants = colors::quantize(&constants, &seen, step, settings.bits(settings.color_step));
    Ok(Quantized {
        frame: field.frame(),
        basis: field.basis(),
        activation: field.activation(),
        up: field.up(),
        depth: field.depth(),
        nodes: field.nodes().to_vec(),
        densities,
        levels,
        step,
        constants,
        table_step,
        table,
        rows: book.rows,
    })
}

/// Scales how leaves are seen, so that the mean over all leaves is 1.
fn normalize(seen: &mut [Seen]) {
    let mean = |of: fn(&Seen) -> f64| seen.iter().map(of).sum::<f64>() / seen.len() as f64;
    let color = mean(|seen| seen.channels.iter().map(|weight| f64::from(*weight)).sum::<f64>() / 3.0);
    let depth = mean(|seen| seen.depth.into());
    for seen in seen {
        if color > 0.0 {
            seen.channels = seen.channels.map(|weight| (f64::from(weight) / color) as f32);
        }
        if depth > 0.0 {
            seen.depth = (f64::from(seen.depth) / depth) as f32;
        }
    }
}
