//! The file of histograms.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
};

use npyz::WriterBuilder;
use plenoctree::sampling::{Histograms, SamplingSettings};
use zip::{ZipWriter, write::FileOptions};

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
