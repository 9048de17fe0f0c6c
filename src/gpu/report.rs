//! What became of the fields on the GPU, for the main world.

use std::sync::{Arc, Mutex, PoisonError};

use bevy::prelude::*;
use plenoctree::PlenOctree;

use super::upload::FieldTooLarge;

/// A field is on the GPU: its props are drawn from the next frame on. Written in [`PreUpdate`], again whenever the field
/// was reloaded.
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldReady {
    /// The field.
    pub field: AssetId<PlenOctree>,
}

/// The GPU cannot hold a field, or a level of it that a camera's [`PropQuality`](crate::PropQuality) asks for. Written in
/// [`PreUpdate`].
///
/// The props of a field that does not fit are not drawn. Where only a level does not fit, the field is drawn as it is.
#[derive(Message, Clone, Debug, PartialEq, Eq)]
pub struct FieldFailed {
    /// The field.
    pub field: AssetId<PlenOctree>,
    /// Which part of it does not fit, and why.
    pub error: FieldTooLarge,
}

type Report = (AssetId<PlenOctree>, Result<(), FieldTooLarge>);

/// Carries reports from the render world to the main world; both hold it.
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

/// Writes the messages. Runs in the main world.
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
