//! Reads histograms from `.npz` files.

use std::{fs::File, io::BufReader, path::Path};

use super::{
    error::{ReadError, ReadFault},
    npz::Archive,
};
use crate::histograms::Histograms;

impl Histograms {
    /// Reads histograms from the arrays `fine` and `coarse` of an `.npz` file: cubes of weights in float64, with the same
    /// number of bins for each channel, at most 64 and 16. Their number of samples is unknown, and counts as 0.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, or if an array is missing, damaged, or not such a cube.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        let read = || {
            let mut archive = Archive::open(BufReader::new(File::open(path)?))?;
            let (fine_bins, fine) = cube(&mut archive, "fine", 64)?;
            let (coarse_bins, coarse) = cube(&mut archive, "coarse", 16)?;
            Self::new(fine_bins, fine, coarse_bins, coarse, 0).map_err(|error| ReadFault::Value {
                key: "histograms",
                found: error.to_string(),
                expected: "finite weights that are not negative".into(),
            })
        };
        read().map_err(|fault| {
            let fault = match fault {
                ReadFault::NotAnArchive { found } => {
                    ReadFault::Value { key: "histograms", found, expected: "an npz archive".into() }
                }
                fault => fault,
            };
            ReadError::new(&path.display().to_string(), fault)
        })
    }
}

/// Reads a cube of weights. Returns the number of bins per channel and the weights.
fn cube(archive: &mut Archive<BufReader<File>>, key: &'static str, most: u64) -> Result<(usize, Vec<f64>), ReadFault> {
    let array = archive.array(key, "a histogram")?;
    if (array.dtype().kind, array.dtype().size) != ('f', 8) {
        return Err(array.dtype_fault("float64"));
    }
    let bins = match *array.shape() {
        [bins, g, b] if bins == g && bins == b && (1..=most).contains(&bins) => bins as usize,
        _ => return Err(array.shape_fault(format!("three equal sides of 1 to {most}"))),
    };
    let mut weights = vec![0.0; bins.pow(3)];
    array.stream(1, usize::MAX, |start, numbers: &[f64]| {
        weights[start..start + numbers.len()].copy_from_slice(numbers);
        Ok(())
    })?;
    Ok((bins, weights))
}
