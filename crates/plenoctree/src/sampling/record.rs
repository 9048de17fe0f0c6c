//! Records histograms in fields that will be packed.

use std::sync::Arc;

use super::{
    progress::{Canceled, Progress},
    sampler::{SamplingError, sample},
};
use crate::{
    field::PlenOctree,
    histograms::{Recorded, SamplingSettings},
};

impl PlenOctree {
    /// Samples the field with the default settings, and returns the field with the histograms that were found.
    /// [`Self::histograms`] returns them, and
    /// [`PackSettings::record_histograms`](crate::PackSettings::record_histograms) records them in packed files. So a
    /// field that is changed before it is packed, for example by `plenoctree_fit::simplify`, keeps a palette that is a
    /// hull or fitted. A palette of tones stays close to the original, because tones also depend on views of the field
    /// itself.
    ///
    /// Returns the field unchanged if it has histograms already, or if nothing of it is visible.
    ///
    /// # Errors
    ///
    /// Returns an error if [`Progress::cancel`](Progress::cancel) is called.
    pub fn recording_histograms(self, progress: &Progress) -> Result<Self, Canceled> {
        let settings = SamplingSettings::default();
        if self.recorded().is_some() {
            return Ok(self);
        }
        match sample(&self, &settings, progress) {
            Ok(histograms) => Ok(self.with_recorded(Recorded::new(&settings, &histograms).map(Arc::new))),
            Err(SamplingError::Canceled(canceled)) => Err(canceled),
            // The default settings are valid.
            Err(SamplingError::Setting(_)) => Ok(self),
        }
    }
}
