//! Systems that update fields on the GPU, every frame.

use std::time::Duration;

use bevy::{
    platform::{collections::HashSet, time::Instant},
    prelude::*,
    render::{
        Extract,
        render_asset::{ExtractedAssets, RenderAssets},
        renderer::RenderAdapterInfo,
    },
};
use plenoctree::PlenOctree;
use wgpu::DeviceType;

use super::{
    budget::{Allowance, UploadBudget},
    field::GpuField,
    layout::TreeShape,
    readiness::Readiness,
    report::{FieldReports, Report},
    upload::Uploader,
};
use crate::background::spare_cores;

/// Extracts the fields that Bevy extracted while there was no device, and dropped: it extracts only those again that
/// had reached the device that was lost. Removes those that apps removed: Bevy keeps them while there are handles.
pub(super) fn extract_missing(
    mut extracted: ResMut<ExtractedAssets<GpuField>>,
    on_gpu: Res<RenderAssets<GpuField>>,
    fields: Extract<Res<Assets<PlenOctree>>>,
    // Bevy may extract a field one frame late.
    mut before: Local<HashSet<AssetId<PlenOctree>>>,
) {
    let missing: HashSet<_> = fields.ids().filter(|id| on_gpu.get(*id).is_none()).collect();
    for id in missing.intersection(&before) {
        if let Some(field) = fields.get(*id)
            && extracted.added.insert(*id)
        {
            extracted.extracted.push((*id, field.clone()));
        }
    }
    *before = missing;
    extracted.removed.extend(on_gpu.iter().map(|(id, _)| id).filter(|id| !fields.contains(*id)));
}

/// Makes and uploads fields, and the levels that views requested in this frame, as far as the budget allows.
pub(super) fn upload_levels(
    mut fields: ResMut<RenderAssets<GpuField>>,
    uploader: Uploader,
    budget: Res<UploadBudget>,
    reports: Res<FieldReports>,
    adapter: Res<RenderAdapterInfo>,
    mut last: Local<Option<Instant>>,
) {
    let being_made: usize = fields.iter().map(|(_, field)| field.threads()).sum();
    let now = Instant::now();
    let last_frame = last.replace(now).map_or(Duration::ZERO, |last| now - last);
    let is_emulated = adapter.device_type == DeviceType::Cpu;
    let mut allowance = Allowance::new(*budget, last_frame, is_emulated, spare_cores().saturating_sub(being_made));
    for (id, field) in fields.iter_mut() {
        let failure = field.advance(&uploader, &mut allowance);
        // The failure of a field itself is reported at the end of the frame.
        if let Some(error) = failure.filter(|_| !matches!(field.outcome(), Some(Err(_)))) {
            error!("a level of field {id} is not drawn: {error}");
            reports.send(Report::Level(id, error));
        }
    }
}

/// Ends the frame: fields that have arrived, and whose pipelines are compiled, are drawn from the next frame on.
/// Reports whether fields fit on the GPU, and the progress of those that are arriving.
pub(super) fn end_frame(
    mut fields: ResMut<RenderAssets<GpuField>>,
    readiness: Res<Readiness>,
    reports: Res<FieldReports>,
) {
    for (id, field) in fields.iter_mut() {
        let shape = field.arriving_shape();
        field.end_frame(shape.is_none_or(|shape| !readiness.waiting.contains(&TreeShape::from(shape))));
        if let Some(outcome) = field.take_outcome() {
            if let Err(error) = &outcome {
                error!("field {id} cannot be drawn: {error}");
            }
            reports.send(Report::Field(id, outcome));
        } else if field.outcome().is_none() {
            reports.send(Report::Progress(id, field.progress()));
        }
    }
}
