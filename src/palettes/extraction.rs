//! Extraction beside the running app.

use std::{collections::HashMap, sync::Arc};

use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};

use super::{FieldPalette, Palettes};
use crate::{
    field::PlenOctree,
    palette::{Extraction, ExtractionError, ExtractionSettings, Progress, extract},
    picture::{Posterize, Prop},
};

/// The palettes that are being extracted, and how.
///
/// A field of a posterised prop that has no palette gets one: in a task, on all cores, while the app keeps running.
#[derive(Resource, Default)]
pub struct PaletteExtraction {
    /// Settings of the extractions that start from now on.
    pub settings: ExtractionSettings,
    running: HashMap<AssetId<PlenOctree>, Running>,
    failed: HashMap<AssetId<PlenOctree>, ExtractionError>,
}

struct Running {
    progress: Arc<Progress>,
    task: Task<Result<Extraction, ExtractionError>>,
}

impl PaletteExtraction {
    /// How far the extraction of a field's palette is, 0 to 1; `None` if there is none under way.
    pub fn progress(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<f32> {
        self.running.get(&field.into()).map(|running| running.progress.fraction() as f32)
    }

    /// Why a field's palette could not be extracted.
    pub fn error(&self, field: impl Into<AssetId<PlenOctree>>) -> Option<&ExtractionError> {
        self.failed.get(&field.into())
    }
}

/// Drops what was found out about fields that changed or are gone.
pub(super) fn forget(
    mut events: MessageReader<AssetEvent<PlenOctree>>,
    mut extraction: ResMut<PaletteExtraction>,
    mut palettes: ResMut<Palettes>,
) {
    for event in events.read() {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else {
            continue;
        };
        extraction.failed.remove(id);
        if let Some(running) = extraction.running.remove(id) {
            running.progress.cancel();
        }
        let removed = matches!(event, AssetEvent::Removed { .. });
        // A palette that a user gave survives a hot reload.
        if palettes.get(*id).is_some_and(|palette| removed || palette.extraction().is_some()) {
            palettes.remove(*id);
        }
    }
}

pub(super) fn start(
    mut extraction: ResMut<PaletteExtraction>,
    palettes: Res<Palettes>,
    fields: Res<Assets<PlenOctree>>,
    props: Query<&Prop, With<Posterize>>,
) {
    for Prop(handle) in &props {
        let id = handle.id();
        let known =
            palettes.get(id).is_some() || extraction.running.contains_key(&id) || extraction.failed.contains_key(&id);
        let Some(field) = fields.get(handle).filter(|_| !known) else {
            continue;
        };
        let progress = Arc::new(Progress::default());
        let (field, settings, shared) = (field.clone(), extraction.settings.clone(), progress.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move { extract(&field, &settings, &shared) });
        extraction.running.insert(id, Running { progress, task });
    }
}

pub(super) fn finish(mut extraction: ResMut<PaletteExtraction>, mut palettes: ResMut<Palettes>) {
    if extraction.running.is_empty() {
        return;
    }
    let PaletteExtraction { running, failed, .. } = &mut *extraction;
    running.retain(|id, running| {
        let Some(result) = block_on(poll_once(&mut running.task)) else {
            return true;
        };
        match result {
            Ok(found) => palettes.insert(*id, FieldPalette::extracted_by(found)),
            Err(error) => {
                error!("{id} has no palette: {error}");
                failed.insert(*id, error);
            }
        }
        false
    });
}
