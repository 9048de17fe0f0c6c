//! Measures, formats and summarizes the differences between neighboring frames.

use image::RgbImage;
use plenoctree_cli::number::counted;

use crate::plot::{self, COLORS, Line};

/// A difference is a spike if it is more than this many times that of the frames as trained, which is motion alone.
const SPIKE: f64 = 1.5;

/// A kind of frame to compare.
pub struct Column {
    /// Its name in files, such as `per_frame_recolored`.
    pub name: String,
    /// Its name for readers.
    pub label: String,
    /// The index of its color in plots.
    pub color: usize,
    /// Whether its frames are recolored.
    pub recolored: bool,
    /// The difference between each frame and the previous one. The first compares frames 0 and 1.
    pub differences: Vec<f64>,
}

/// The differences between each frame and the previous one, for every kind of frame.
pub struct Series {
    /// The kinds of frames. The first is as trained.
    pub columns: Vec<Column>,
    last: Option<Vec<RgbImage>>,
}

impl Series {
    /// Creates a series without frames. The first column is for frames as trained.
    pub fn new(columns: Vec<Column>) -> Self {
        Self { columns, last: None }
    }

    /// Adds the next frame: an image of every kind.
    pub fn push(&mut self, images: Vec<RgbImage>) {
        if let Some(last) = &self.last {
            for ((column, last), next) in self.columns.iter_mut().zip(last).zip(&images) {
                column.differences.push(mean_difference(last, next));
            }
        }
        self.last = Some(images);
    }

    /// Returns the number of pairs of frames whose difference is a spike.
    pub fn spikes(&self, column: &Column) -> usize {
        let trained = self.columns.iter().flat_map(|column| &column.differences);
        column.differences.iter().zip(trained).filter(|(own, trained)| **own > SPIKE * **trained).count()
    }

    /// Formats comma-separated values: a row for every pair of frames, named by its second frame.
    pub fn csv(&self) -> String {
        let names: Vec<_> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let mut text = format!("frame,{}\n", names.join(","));
        let pairs = self.columns.first().map_or(0, |column| column.differences.len());
        for pair in 0..pairs {
            let values: Vec<_> = self.columns.iter().map(|column| format!("{:.6}", column.differences[pair])).collect();
            text += &format!("{},{}\n", pair + 1, values.join(","));
        }
        text
    }

    /// Plots the columns over the frames.
    pub fn svg(&self, field: &str) -> String {
        let lines = self.columns.iter().map(|column| Line {
            label: format!(
                "{}: mean {:.4}, worst {:.4}, {}",
                column.label,
                column.mean(),
                column.worst().1,
                counted(self.spikes(column), "spike", "spikes")
            ),
            color: COLORS[column.color % COLORS.len()],
            dashed: column.recolored,
            points: column.differences.iter().enumerate().map(|(pair, value)| ((pair + 1) as f64, *value)).collect(),
        });
        let title = format!("Mean absolute difference of neighboring frames, {field}");
        plot::lines(&title, "frame, over a turn of 90 degrees", "difference", &lines.collect::<Vec<_>>())
    }
}

impl Column {
    /// Returns the mean difference.
    pub fn mean(&self) -> f64 {
        self.differences.iter().sum::<f64>() / self.differences.len().max(1) as f64
    }

    /// Returns the frame that differs most from the previous one, and how much.
    pub fn worst(&self) -> (usize, f64) {
        let pairs = self.differences.iter().enumerate().map(|(pair, difference)| (pair + 1, *difference));
        pairs.fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
    }
}

/// Returns the mean absolute difference of encoded sRGB over all pixels and channels, in [0, 1].
pub fn mean_difference(a: &RgbImage, b: &RgbImage) -> f64 {
    let sum: u64 = a.iter().zip(b.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / (255.0 * a.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(differences: &[f64]) -> Column {
        Column { name: "a".into(), label: "a".into(), color: 0, recolored: false, differences: differences.to_vec() }
    }

    /// Fast motion is not a spike, but a change beyond the motion is.
    #[test]
    fn a_flash_is_a_spike() {
        let trained = column(&[0.01, 0.04, 0.01, 0.02]);
        let posterized = column(&[0.012, 0.05, 0.05, 0.031]);
        let series = Series { columns: vec![trained, posterized], last: None };
        let [trained, posterized] = &series.columns[..] else { panic!() };
        assert_eq!((series.spikes(trained), series.spikes(posterized)), (0, 2));
        assert_eq!(posterized.worst(), (2, 0.05));
    }
}
