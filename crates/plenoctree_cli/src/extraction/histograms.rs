//! The file of histograms.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, Read, Write},
    path::Path,
};

use npyz::{NpyFile, WriterBuilder};
use plenoctree::sampling::{Histograms, SamplingSettings};
use zip::{ZipArchive, ZipWriter, write::FileOptions};

use crate::{files, result::Result};

/// Writes the arrays `fine` and `coarse` in float64, indexed by [r, g, b] and not normalized.
pub fn write(histograms: &Histograms, settings: &SamplingSettings, path: &Path) -> Result {
    files::write(path, |file| write_to(histograms, settings, file))
}

fn write_to(histograms: &Histograms, settings: &SamplingSettings, file: &mut File) -> io::Result<()> {
    let mut archive = ZipWriter::new(BufWriter::new(file));
    for (name, weights, bins) in
        [("fine.npy", histograms.fine(), settings.fine_bins), ("coarse.npy", histograms.coarse(), settings.coarse_bins)]
    {
        // Omit the time of writing, so that the same field gives the same file.
        let options = FileOptions::default().last_modified_time(Default::default());
        archive.start_file(name, options)?;
        let shape = [bins as u64; 3];
        let array = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut archive).begin_nd();
        let mut array = array?;
        array.extend(weights.iter().copied())?;
        array.finish()?;
    }
    archive.finish()?.flush()
}

/// Reads the arrays `fine` and `coarse`, as `write` writes them.
pub fn read(path: &Path) -> Result<Histograms> {
    let named = |error: String| format!("{}: {error}", path.display());
    let file = File::open(path).map_err(|error| named(error.to_string()))?;
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(|error| named(error.to_string()))?;
    let (fine_bins, fine) = array(&mut archive, "fine", 64).map_err(named)?;
    let (coarse_bins, coarse) = array(&mut archive, "coarse", 16).map_err(named)?;
    let histograms = Histograms::new(fine_bins, fine, coarse_bins, coarse, 0);
    Ok(histograms.map_err(|error| named(error.to_string()))?)
}

/// Reads a cube of weights in float64 with at most `most` bins per channel. Returns the number of bins per channel and
/// the weights.
fn array(archive: &mut ZipArchive<impl Read + io::Seek>, name: &str, most: usize) -> Result<(usize, Vec<f64>), String> {
    let failed = |error: &dyn std::fmt::Display| format!("array {name}: {error}");
    let file = format!("{name}.npy");
    // Opening an encrypted member without a password can panic, so try with one, which is used only if it is needed.
    match archive.by_name_decrypt(&file, &[]) {
        Ok(Ok(_)) => {}
        Ok(Err(_)) => return Err(failed(&"found an encrypted array, expected one without a password")),
        Err(error) => return Err(failed(&error)),
    }
    let member = archive.by_name(&file).map_err(|error| failed(&error))?;
    let npy = NpyFile::new(member).map_err(|error| failed(&error))?;
    let bins = match npy.shape() {
        &[bins, g, b] if bins == g && bins == b && (1..=most as u64).contains(&bins) => bins as usize,
        shape => return Err(failed(&format!("found the shape {shape:?}, expected three equal sides of 1 to {most}"))),
    };
    if npy.header().order() != npyz::Order::C {
        return Err(failed(&"found Fortran order, expected C order"));
    }
    let dtype = npy.dtype().descr();
    let weights =
        npy.data::<f64>().map_err(|_| failed(&format!("found elements of type {dtype}, expected float64")))?;
    let weights: io::Result<Vec<f64>> = weights.collect();
    Ok((bins, weights.map_err(|error| failed(&error))?))
}
