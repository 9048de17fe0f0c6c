//! The coefficients of leaves that a codebook is built for.

use super::metric::{Metric, add_diagonal, product, solve};
use crate::sampling::Seen;

/// Parts of the coefficients of leaves: their luma, or both differences.
pub(super) struct Leaves<'a> {
    pub metric: &'a Metric,
    pub seen: &'a [Seen],
    /// How much an error counts in each part, relative to the leaf's weight.
    pub shares: &'static [f32],
    /// For each leaf, the coefficients of its parts.
    pub values: Vec<f32>,
    /// Bits that a squared coefficient of a leaf of average visibility is worth.
    pub scale: f32,
}

impl Leaves<'_> {
    pub fn others(&self) -> usize {
        self.metric.others()
    }

    /// Returns the number of coefficients of a leaf.
    pub fn width(&self) -> usize {
        self.shares.len() * self.others()
    }

    pub fn value(&self, leaf: usize) -> &[f32] {
        &self.values[leaf * self.width()..][..self.width()]
    }

    pub fn weight(&self, leaf: usize) -> f32 {
        self.seen[leaf].total() * self.scale
    }

    /// Returns the covariances of the functions over the views of a leaf.
    pub fn covariances<'m>(&self, leaf: usize, moments: &'m mut Vec<f32>) -> &'m [f32] {
        self.metric.of(&self.seen[leaf].views, moments);
        &moments[self.others()..]
    }

    /// Returns how many bits it is worth to keep a leaf's coefficients.
    pub fn worth(&self, leaf: usize, moments: &mut Vec<f32>) -> f32 {
        let covariances = self.covariances(leaf, moments);
        let mut image = vec![0.0; self.others()];
        let parts = self.value(leaf).chunks_exact(self.others()).zip(self.shares);
        let squares = parts.map(|(part, share)| {
            product(covariances, part, &mut image);
            share * part.iter().zip(&image).map(|(a, b)| a * b).sum::<f32>()
        });
        self.weight(leaf) * squares.sum::<f32>()
    }

    /// Returns a leaf's coefficients, shrunk where they are not visible: the most likely ones if coefficients vary by
    /// `deviation`.
    pub fn likeliest(&self, leaf: usize, deviation: f32, moments: &mut Vec<f32>) -> Vec<f32> {
        let others = self.others();
        let covariances = self.covariances(leaf, moments);
        let mut values = Vec::with_capacity(self.width());
        for (part, share) in self.value(leaf).chunks_exact(others).zip(self.shares) {
            let weight = self.weight(leaf) * share;
            let mut image = vec![0.0; others];
            product(covariances, part, &mut image);
            let mut vector: Vec<f64> = image.iter().map(|number| f64::from(weight * number)).collect();
            let mut matrix: Vec<f64> = covariances.iter().map(|number| f64::from(weight * number)).collect();
            // Bits of a normal distribution: the square over the variance, by 2 ln 2.
            add_diagonal(&mut matrix, others, 0.72 / f64::from(deviation * deviation).max(1e-20));
            solve(&matrix, &mut vector);
            values.extend(vector.iter().map(|number| *number as f32));
        }
        values
    }
}
