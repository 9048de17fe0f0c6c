//! Reports to the main world which fields are on the GPU, and which do not fit.

use std::sync::{Arc, Mutex, PoisonError};

use bevy::prelude::*;
use plenoctree::PlenOctree;

use super::upload::FieldTooLarge;

/// A message written in [`PreUpdate`] when a field is on the GPU, and again whenever the field is reloaded.
///
/// The field's props are drawn from the next frame on.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldReady {
    /// The field.
    pub field: AssetId<PlenOctree>,
}

/// A message written in [`PreUpdate`] when the GPU cannot hold a field, or a level of it that a camera's
/// [`PropQuality`](crate::PropQuality) requests.
///
/// Props of a field that does not fit are not drawn. If only a level does not fit, another level is drawn in its place.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct FieldFailed {
    /// The field.
    pub field: AssetId<PlenOctree>,
    /// The part that does not fit, and its size.
    pub error: FieldTooLarge,
}

type Report = (AssetId<PlenOctree>, Result<(), FieldTooLarge>);

/// Carries reports from the render world to the main world. Both worlds hold a clone.
#[derive(Resource, Clone, Default)]
pub(super) struct FieldReports(Arc<Mutex<Vec<Report>>>);

impl FieldReports {
    pub fn push(&self, field: AssetId<PlenOctree>, outcome: Result<(), FieldTooLarge>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push((field, outcome));
    }

    fn take(&self) -> Vec<Report> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Writes reports as messages. Runs in the main world.
pub(super) fn receive(
    reports: Res<FieldReports>,
    mut ready: MessageWriter<FieldReady>,
    mut failed: MessageWriter<FieldFailed>,
) {
    for (field, outcome) in reports.take() {
        match outcome {
            Ok(()) => {
                ready.write(FieldReady { field });
            }
            Err(error) => {
                failed.write(FieldFailed { field, error });
            }
        }
    }
}
