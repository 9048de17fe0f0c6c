//! Systems that update fields on the GPU, every frame.

use bevy::{prelude::*, render::render_asset::RenderAssets};

use super::{field::GpuField, report::FieldReports, upload::Uploader};

/// Uploads the levels that views requested in this frame, and reports whether fields and levels fit on the GPU.
pub(super) fn upload_levels(
    mut fields: ResMut<RenderAssets<GpuField>>,
    uploader: Uploader,
    reports: Res<FieldReports>,
) {
    for (id, field) in fields.iter_mut() {
        let failure = field.upload(&uploader);
        if let Some(outcome) = field.take_outcome() {
            if let Err(error) = &outcome {
                error!("field {id} is not drawn: {error}");
            }
            reports.field(id, outcome);
        } else if let Some(error) = failure {
            error!("a level of field {id} is not drawn: {error}");
            reports.level(id, error);
        }
    }
}

/// Evicts levels that no camera has requested for a long time.
pub(super) fn evict_levels(mut fields: ResMut<RenderAssets<GpuField>>) {
    for (_, field) in fields.iter_mut() {
        field.age();
    }
}
