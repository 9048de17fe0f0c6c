//! The point of leaves at which radiance is sampled.

/// Where in a leaf its radiance is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SamplePoint {
    /// At its center, as in the paper. The transmittance of a sample is that from the center to the observer.
    Center,
    /// Where a ray from the observer enters it. The transmittance of a sample is the mean along the ray's path through
    /// the leaf. For fields whose visible leaves let hardly any light through, so that their centers are hidden.
    Entry,
}

impl SamplePoint {
    /// Returns the factor by which the transmittance from the point to the observer is multiplied, for a ray on whose
    /// way from the leaf's center to the observer the leaf itself has an optical depth of `own`.
    pub(super) fn share(self, own: f64) -> f64 {
        match self {
            Self::Entry if own > 0.0 => -(-2.0 * own).exp_m1() / (2.0 * own),
            _ => 1.0,
        }
    }
}
