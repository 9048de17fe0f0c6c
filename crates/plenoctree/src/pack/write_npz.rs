//! Writes a packed field in the quantized layout that volrend reads.

use std::io::{BufWriter, Seek, Write};
use std::path::Path;

use half::f16;
use rayon::prelude::*;

use super::{packed::Packed, split::shared};
use crate::{
    field::PlenOctree,
    file::{Archive, MAX_ROWS, WriteError, check_written, half_density},
    save::replace_file,
};

impl Packed {
    /// Writes the field as an `.npz` file in the published quantized layout, which volrend and [`PlenOctree::read`]
    /// read: a codebook of 65,536 colors for every function. Replaces an existing file.
    ///
    /// Reading it gives the packed field, except that it takes as much memory as an unpacked one, and that the
    /// coefficients of a function are rounded to 65,536 distinct colors, if there are more.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`PlenOctree::write`].
    pub fn write_npz(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        replace_file(path.as_ref(), |file| write_quantized(self.field(), file))
    }
}

fn write_quantized(field: &PlenOctree, mut writer: impl Write + Seek) -> Result<(), WriteError> {
    check_written(field.frame())?;
    let mut archive = Archive::new(BufWriter::new(&mut writer));
    let functions = field.basis().functions();
    let nodes = field.nodes().len() as u64;
    let leaves = || field.nodes().as_flattened().iter().map(|cell| cell.as_leaf().map(|leaf| leaf as usize));
    archive.structure(field)?;
    archive.frame(field)?;
    archive.text("data_format", field.basis().name())?;
    let sigma = leaves().map(|leaf| leaf.map_or(f16::ZERO, |leaf| half_density(field.densities()[leaf])));
    archive.array("sigma", &[nodes, 2, 2, 2], sigma)?;

    // For each function, the colors in its codebook, and the color of each leaf.
    let mut of_functions = vec![Vec::with_capacity(field.leaves()); functions];
    for leaf in 0..field.leaves() {
        let colors = field.stored().of_functions(field.basis(), leaf);
        of_functions.iter_mut().zip(colors).for_each(|(all, color)| all.push(color));
    }
    let books: Vec<_> = of_functions.par_iter().map(|colors| shared(colors, MAX_ROWS)).collect();
    // Readers expect this many rows, used or not.
    let padded = |colors: &[[f16; 3]]| {
        let rest = MAX_ROWS - colors.len();
        colors.iter().copied().chain(std::iter::repeat_n([f16::ZERO; 3], rest)).flatten().collect::<Vec<_>>()
    };
    let all = books.iter().flat_map(|(colors, _)| padded(colors));
    archive.array("quant_colors", &[functions as u64, MAX_ROWS as u64, 3], all)?;
    let map = books.iter().flat_map(|(_, rows)| leaves().map(|leaf| leaf.map_or(0, |leaf| rows[leaf])));
    archive.array("quant_map", &[functions as u64, nodes, 2, 2, 2], map)?;
    // The coefficients, or the largest array.
    archive.finish(2 * functions as u64 * (3 * field.leaves() as u64).max(8 * nodes))
}
