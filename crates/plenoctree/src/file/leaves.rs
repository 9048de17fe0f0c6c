//! Reads densities and coefficients from the `data` array of a file.

use std::fmt::Display;
use std::io::{self, Read, Seek};

use half::f16;

use super::error::ReadFault;
use super::npy::{REALS, Real, with_real};
use super::npz::{Archive, Array};
use super::walk::Tree;
use crate::field::Basis;

/// The valid values of a coefficient, for messages.
pub(super) const COEFFICIENT: &str = "a coefficient from -65504 to 65504";

/// Reads the densities and coefficients of the leaves whose density passes `keep`, and drops the others.
pub(super) fn read_data(
    archive: &mut Archive<impl Read + Seek>,
    basis: Basis,
    tree: &mut Tree,
    keep: impl Fn(f32) -> bool,
) -> Result<(Vec<f32>, Vec<f16>), ReadFault> {
    let values = basis.coefficients() + 1;
    let array = open(archive, tree, values)?;
    if !array.fortran() {
        return read_rows(array, values, tree, keep);
    }
    // In Fortran order all densities come last, but they decide which coefficients to keep. This takes two passes.
    let density = read_density(array, values, tree)?;
    let density = tree.keep(density, keep);
    let coefficients = read_columns(open(archive, tree, values)?, values, tree)?;
    Ok((density, coefficients))
}

fn open<'a>(archive: &'a mut Archive<impl Read + Seek>, tree: &Tree, values: usize) -> Result<Array<'a>, ReadFault> {
    let array = archive.array("data", "the coefficients and densities")?;
    array.check_shape(&[tree.file_nodes(), 2, 2, 2, values as u64])?;
    Ok(array)
}

/// Reads the density of every leaf: the last of the `values` numbers of its cell.
pub(super) fn read_density(array: Array, values: usize, tree: &Tree) -> Result<Vec<f32>, ReadFault> {
    let fault = array.dtype_fault(REALS);
    let key = array.key();
    let mut density = zeros(tree.leaves)?;
    with_real!(array.dtype(), T => array.stream::<T>(values, tree.end() * values, |first, numbers| {
        let (cell, end) = (first / values, first % values + numbers.len());
        if let (Some(leaf), Some(&sigma), true) = (tree.leaf(cell), numbers.last(), end == values) {
            density[leaf] = finite_density(key, sigma, cell)?;
        }
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    Ok(density)
}

/// Reads densities and coefficients in one pass over an array in C order, where the values of a cell are contiguous.
fn read_rows(
    array: Array,
    values: usize,
    tree: &mut Tree,
    keep: impl Fn(f32) -> bool,
) -> Result<(Vec<f32>, Vec<f16>), ReadFault> {
    let fault = array.dtype_fault(REALS);
    let mut density = zeros(tree.leaves)?;
    let mut rows = Vec::new();
    with_real!(array.dtype(), T => array.stream::<T>(values, tree.end() * values, |first, numbers| {
        let cell = first / values;
        if let (Some(leaf), Some((&sigma, coefficients))) = (tree.leaf(cell), numbers.split_last()) {
            density[leaf] = finite_density("data", sigma, cell)?;
            if keep(density[leaf]) {
                let row = rows.len();
                rows.extend(coefficients.iter().map(|number| number.to_f16().unwrap_or(f16::NAN)));
                // Checking a whole row is faster than checking its numbers one by one.
                if rows[row..].iter().any(|number| number.is_nan()) {
                    coefficients.iter().try_for_each(|number| coefficient("data", *number, cell).map(|_| ()))?;
                }
            }
        }
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    rows.shrink_to_fit();
    let density = tree.keep(density, keep);
    // Rows are in the order of the file's cells. Only now is the final leaf of every row known.
    move_rows(&mut rows, values - 1, (0..tree.cells()).filter_map(|cell| tree.leaf(cell)).collect());
    Ok((density, rows))
}

/// Reads the coefficients of every leaf from an array in Fortran order.
fn read_columns(array: Array, values: usize, tree: &Tree) -> Result<Vec<f16>, ReadFault> {
    let fault = array.dtype_fault(REALS);
    let count = values - 1;
    let mut coefficients = zeros(tree.leaves * count)?;
    with_real!(array.dtype(), T => array.stream::<T>(1, tree.end() * values, |index, number| {
        let (cell, place) = (index / values, index % values);
        if let Some(leaf) = tree.leaf(cell).filter(|_| place < count) {
            coefficients[leaf * count + place] = coefficient("data", number[0], cell)?;
        }
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    Ok(coefficients)
}

/// Moves row `i` to row `targets[i]`, in place, because memory may not hold two copies of a large field.
fn move_rows(rows: &mut [f16], width: usize, mut targets: Vec<usize>) {
    let mut carried = vec![f16::ZERO; width];
    for first in 0..targets.len() {
        let mut target = std::mem::replace(&mut targets[first], first);
        if target == first {
            continue;
        }
        // Every row displaces the one at its destination, until one belongs where the first one was.
        carried.copy_from_slice(&rows[first * width..][..width]);
        while target != first {
            carried.swap_with_slice(&mut rows[target * width..][..width]);
            target = std::mem::replace(&mut targets[target], target);
        }
        rows[first * width..][..width].copy_from_slice(&carried);
    }
}

fn finite_density(key: &'static str, sigma: impl Real, cell: usize) -> Result<f32, ReadFault> {
    // svox stores half floats, in which larger densities become infinite.
    let density = if sigma.to_f64() == f64::INFINITY { f16::MAX.to_f32() } else { sigma.to_f32() };
    let finite = density.is_finite().then_some(density);
    finite.ok_or_else(|| number_fault(key, sigma, cell, "a density within the range of float32"))
}

/// Rounds a coefficient to float16, the precision in which fields store it.
#[inline]
pub(super) fn coefficient(key: &'static str, number: impl Real, cell: usize) -> Result<f16, ReadFault> {
    number.to_f16().ok_or_else(|| number_fault(key, number, cell, COEFFICIENT))
}

/// Returns the error for an invalid number in a cell of the file.
#[cold]
pub(super) fn number_fault(key: &'static str, number: impl Display, cell: usize, expected: &str) -> ReadFault {
    let found = format!("{number} at node {}, cell {}", cell / 8, cell % 8);
    ReadFault::Value { key, found, expected: expected.into() }
}

/// Allocates `count` zeros. Returns an error instead of aborting if memory runs out.
pub(super) fn zeros<T: bytemuck::Zeroable + Clone>(count: usize) -> Result<Vec<T>, ReadFault> {
    let mut numbers = Vec::new();
    numbers.try_reserve_exact(count).map_err(|_| io::Error::from(io::ErrorKind::OutOfMemory))?;
    numbers.resize(count, T::zeroed());
    Ok(numbers)
}
