//! Writes a packed field in the quantized layout that volrend reads.

use std::io::{BufWriter, Seek, Write};
use std::path::Path;

use half::f16;

use super::write::{Archive, WriteError, frame_in_float32, half_density};
use crate::{
    field::PlenOctree,
    pack::{MAX_ROWS, Packed, shared},
    save::save,
};

impl Packed {
    /// Writes the field as an `.npz` file in the published quantized layout, which volrend and [`PlenOctree::read`] read:
    /// a codebook of 65,536 colors for every function. Replaces an existing file.
    ///
    /// Reading it gives the packed field, except that it takes as much memory as an unpacked one, and that the coefficients
    /// of the constant function are rounded to 65,536 different colors, if there are more.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`PlenOctree::write`].
    pub fn write_npz(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        save(path.as_ref(), |file| write_quantized(self.field(), file))
    }
}

fn write_quantized(field: &PlenOctree, writer: impl Write + Seek) -> Result<(), WriteError> {
    let Some(codebook) = field.codebook() else { return field.write_to(writer) };
    let (scale, offset) = frame_in_float32(field)?;
    let mut archive = Archive::new(BufWriter::new(writer));
    let functions = field.basis().functions();
    let nodes = field.nodes().len() as u64;
    let leaves = || field.nodes().as_flattened().iter().map(|cell| cell.as_leaf().map(|leaf| leaf as usize));
    archive.structure(field)?;
    archive.array("invradius3", &[3], scale)?;
    archive.array("offset", &[3], offset)?;
    archive.text("data_format", field.basis().name())?;
    let sigma = leaves().map(|leaf| leaf.map_or(f16::ZERO, |leaf| half_density(field.densities()[leaf])));
    archive.array("sigma", &[nodes, 2, 2, 2], sigma)?;

    let (colors, color_rows) = shared(codebook.constants, MAX_ROWS);
    // Readers expect this many rows, used or not.
    let padded = |colors: Vec<[f16; 3]>| {
        let rest = MAX_ROWS - colors.len();
        colors.into_iter().chain(std::iter::repeat_n([f16::ZERO; 3], rest)).flatten()
    };
    let others = functions - 1;
    let of_function = |function: usize| -> Vec<[f16; 3]> {
        let row = |row: &[f16]| [0, 1, 2].map(|channel| row[channel * others + function]);
        codebook.table.chunks_exact((3 * others).max(1)).map(row).collect()
    };
    let all = padded(colors).chain((0..others).flat_map(|function| padded(of_function(function))));
    archive.array("quant_colors", &[functions as u64, MAX_ROWS as u64, 3], all)?;
    let first = leaves().map(|leaf| leaf.map_or(0, |leaf| color_rows[leaf]));
    let row = |leaf: Option<usize>| leaf.and_then(|leaf| codebook.rows.get(leaf)).copied().unwrap_or(0);
    let map = first.chain((0..others).flat_map(|_| leaves().map(row)));
    archive.array("quant_map", &[functions as u64, nodes, 2, 2, 2], map)?;
    Ok(archive.finish()?)
}
