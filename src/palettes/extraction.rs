//! Extraction beside the running app.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

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
    wanted: HashSet<AssetId<PlenOctree>>,
    running: HashMap<AssetId<PlenOctree>, Running>,
    failed: HashMap<AssetId<PlenOctree>, ExtractionError>,
}

struct Running {
    /// Whether a palette that the field was given in the meantime is to be replaced.
    replaces: bool,
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

    /// Extracts a field's palette anew, with the settings as they are now; one that is under way is given up.
    ///
    /// The palette that the field has stays until the new one is there, and is then replaced: changed colours and a
    /// palette that was given as well.
    pub fn restart(&mut self, field: impl Into<AssetId<PlenOctree>>) {
        let id = field.into();
        self.give_up(id);
        self.wanted.insert(id);
    }

    fn give_up(&mut self, id: AssetId<PlenOctree>) {
        self.failed.remove(&id);
        if let Some(running) = self.running.remove(&id) {
            running.progress.cancel();
        }
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
        extraction.give_up(*id);
        let removed = matches!(event, AssetEvent::Removed { .. });
        if removed {
            extraction.wanted.remove(id);
        }
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
    let missing = props.iter().map(|prop| prop.0.id()).filter(|id| {
        palettes.get(*id).is_none() && !extraction.failed.contains_key(id) && !extraction.running.contains_key(id)
    });
    let ids: HashSet<_> = extraction.wanted.iter().copied().chain(missing).collect();
    for id in ids {
        let Some(field) = fields.get(id) else {
            continue;
        };
        let progress = Arc::new(Progress::default());
        let (field, settings, shared) = (field.clone(), extraction.settings.clone(), progress.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move { extract(&field, &settings, &shared) });
        let replaces = extraction.wanted.remove(&id);
        extraction.running.insert(id, Running { replaces, progress, task });
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
            Ok(_) if !running.replaces && palettes.get(*id).is_some() => {}
            Ok(found) => palettes.insert(*id, FieldPalette::extracted_by(found)),
            Err(error) => {
                error!("{id} has no palette: {error}");
                failed.insert(*id, error);
            }
        }
        false
    });
}
