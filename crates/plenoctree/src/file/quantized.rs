//! Reads densities and coefficients from the codebooks of a quantized file.

use std::io::{Read, Seek};

use half::f16;

use super::error::ReadFault;
use super::leaves::{COEFFICIENT, coefficient, number_fault, read_density, zeros};
use super::npy::{REALS, Real, WHOLES, Whole, with_real, with_whole};
use super::npz::Archive;
use super::walk::Tree;
use crate::field::Basis;

/// Arrays that only quantized files have.
pub(super) const QUANTIZED: [&str; 3] = ["sigma", "quant_colors", "quant_map"];

/// Reads the densities and coefficients of the leaves whose density passes `keep`, and drops the others.
pub(super) fn read_quantized(
    archive: &mut Archive<impl Read + Seek>,
    basis: Basis,
    tree: &mut Tree,
    keep: impl Fn(f32) -> bool,
) -> Result<(Vec<f32>, Vec<f16>), ReadFault> {
    let array = archive.array("sigma", "the densities")?;
    array.check_shape(&[tree.file_nodes(), 2, 2, 2])?;
    let density = read_density(array, 1, tree)?;
    let density = tree.keep(density, keep);
    let coefficients = read_coefficients(archive, basis, tree)?;
    Ok((density, coefficients))
}

/// Reads the coefficients of every leaf: those of the first functions directly, the others from one codebook per
/// function.
fn read_coefficients(
    archive: &mut Archive<impl Read + Seek>,
    basis: Basis,
    tree: &Tree,
) -> Result<Vec<f16>, ReadFault> {
    let (cells, nodes) = (tree.cells(), tree.file_nodes());
    let (count, functions) = (basis.coefficients(), basis.functions());
    // A small codebook can expand to a large number of coefficients.
    archive.room("quant_map").check(2 * (tree.leaves * count) as u64)?;
    let mut coefficients = zeros(tree.leaves * count)?;
    let mut retained = 0;
    if archive.has("data_retained") {
        let array = archive.array("data_retained", "the unquantized coefficients")?;
        let &[planes, n, 2, 2, 2, 3] = array.shape() else {
            return Err(array.shape_fault(format!("[Br, {nodes}, 2, 2, 2, 3]")));
        };
        if planes > functions as u64 || n != nodes {
            return Err(array.shape_fault(format!("[Br, {nodes}, 2, 2, 2, 3] with Br at most {functions}")));
        }
        retained = planes as usize;
        let fault = array.dtype_fault(REALS);
        with_real!(array.dtype(), T => array.stream::<T>(3, 3 * cells * retained, |first, numbers| {
            let (function, cell) = (first / 3 / cells, first / 3 % cells);
            if let Some(leaf) = tree.leaf(cell) {
                for (channel, &number) in (first % 3..).zip(numbers) {
                    coefficients[leaf * count + channel * functions + function] =
                        coefficient("data_retained", number, cell)?;
                }
            }
            Ok(())
        }))
        .unwrap_or(Err(fault))?;
    }
    let quantized = functions - retained;
    if quantized == 0 {
        return Ok(coefficients);
    }
    let codebook = read_codebook(archive, quantized)?;
    let rows = codebook.len() / quantized;

    let array = archive.array("quant_map", "row indices into the codebooks")?;
    array.check_shape(&[quantized as u64, nodes, 2, 2, 2])?;
    let fault = array.dtype_fault(WHOLES);
    with_whole!(array.dtype(), T => array.stream::<T>(8, cells * quantized, |first, numbers| {
        for (index, number) in (first..).zip(numbers) {
            let (function, cell) = (index / cells, index % cells);
            let Some(leaf) = tree.leaf(cell) else { continue };
            let row = number.to_i64();
            let Some(row) = usize::try_from(row).ok().filter(|&row| row < rows) else {
                return Err(number_fault("quant_map", row, cell, &format!("a row of quant_colors, 0 to {}", rows - 1)));
            };
            for (channel, &number) in codebook[function * rows + row].iter().enumerate() {
                if !number.is_finite() {
                    let found = format!("{number} in row {row} of function {function}");
                    return Err(ReadFault::Value { key: "quant_colors", found, expected: COEFFICIENT.into() });
                }
                coefficients[leaf * count + channel * functions + retained + function] = number;
            }
        }
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    Ok(coefficients)
}

/// Reads all codebooks, one after another, with one color per row. Numbers out of range become NaN instead of an error,
/// since rows may be unused.
fn read_codebook(archive: &mut Archive<impl Read + Seek>, functions: usize) -> Result<Vec<[f16; 3]>, ReadFault> {
    let array = archive.array("quant_colors", "the codebooks")?;
    let rows = match *array.shape() {
        [planes, rows, 3] if planes == functions as u64 && rows > 0 => rows as usize,
        _ => return Err(array.shape_fault(format!("[{functions}, rows, 3]"))),
    };
    let fault = array.dtype_fault(REALS);
    let mut codebook = vec![[f16::ZERO; 3]; functions * rows];
    with_real!(array.dtype(), T => array.stream::<T>(3, 3 * codebook.len(), |first, numbers| {
        for (number, value) in codebook.as_flattened_mut()[first..].iter_mut().zip(numbers) {
            *number = value.to_f16().unwrap_or(f16::NAN);
        }
        Ok(())
    }))
    .unwrap_or(Err(fault))?;
    Ok(codebook)
}
