//! Measures, saves and summarizes the differences between neighboring frames.

use std::{fmt::Write, path::Path};

use image::RgbImage;

use crate::{Result, files};

/// The kinds of images that are compared, as columns of the file.
pub const COLUMNS: [&str; 5] = ["plain", "field", "per_frame", "field_recolored", "per_frame_recolored"];

/// The images of one view.
pub struct Frame {
    /// In the order of [`COLUMNS`].
    pub images: [RgbImage; COLUMNS.len()],
}

/// The differences between each frame and the previous one.
#[derive(Default)]
pub struct Series {
    /// One row per pair of frames. The first row compares frames 0 and 1.
    rows: Vec<[f64; COLUMNS.len()]>,
    last: Option<Frame>,
}

impl Series {
    /// Adds the next frame.
    pub fn push(&mut self, frame: Frame) {
        if let Some(last) = &self.last {
            let difference = |column: usize| mean_difference(&last.images[column], &frame.images[column]);
            self.rows.push(std::array::from_fn(difference));
        }
        self.last = Some(frame);
    }

    /// Returns the number of pairs of frames.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns the second frame of each pair, and the difference between the two.
    pub fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
        self.rows.iter().enumerate().map(move |(pair, row)| (pair + 1, row[column]))
    }

    /// Returns the mean of a column.
    pub fn mean(&self, column: usize) -> f64 {
        self.column(column).map(|(_, difference)| difference).sum::<f64>() / self.len().max(1) as f64
    }

    /// Returns the frame with the largest value of a column, and that value.
    pub fn largest(&self, column: usize) -> (usize, f64) {
        self.column(column).fold((0, 0.0), |largest, next| if next.1 > largest.1 { next } else { largest })
    }

    /// Writes a file of comma-separated values.
    pub fn write(&self, path: &Path) -> Result {
        let mut text = format!("frame,{}\n", COLUMNS.join(","));
        for (pair, row) in self.rows.iter().enumerate() {
            let values = row.map(|difference| format!("{difference:.6}")).join(",");
            writeln!(text, "{},{values}", pair + 1)?;
        }
        files::write_text(path, &text)
    }

    /// Returns a table of means and largest values.
    pub fn summary(&self) -> String {
        let mut text = format!("{:20} {:>8} {:>8}\n", "", "mean", "largest");
        for (column, name) in COLUMNS.iter().enumerate() {
            let (frame, largest) = self.largest(column);
            text += &format!("{name:20} {:8.5} {largest:8.5} at frame {frame}\n", self.mean(column));
        }
        text
    }
}

/// Returns the mean absolute difference over all pixels and channels, in [0, 1].
fn mean_difference(a: &RgbImage, b: &RgbImage) -> f64 {
    let sum: u64 = a.iter().zip(b.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / (255.0 * a.len().max(1) as f64)
}
