//! Finds out what props wait for.

use bevy::{asset::LoadState, platform::collections::HashMap, prelude::*};
use plenoctree::PlenOctree;

use super::drawn::DrawnOverride;
use crate::{
    asset::FilesRead,
    gpu::GpuStatus,
    palette::{PaletteExtraction, PaletteOverride, Palettes},
    posterize::{BeforePalette, Posterize},
    prop::{DrawnField, Prop, PropError, PropProgress, PropState},
    recolor::{Recolor, before_palette},
};

pub(super) fn update(
    mut commands: Commands,
    mut props: Query<(
        (Entity, Ref<Prop>),
        (Option<&Posterize>, Option<&Recolor>),
        (Option<&PaletteOverride>, Option<&mut DrawnOverride>),
        &mut PropState,
        &mut PropProgress,
        &mut DrawnField,
    )>,
    mut states: Local<HashMap<(AssetId<PlenOctree>, bool), PropState>>,
    fields: Res<Assets<PlenOctree>>,
    server: Res<AssetServer>,
    files: Res<FilesRead>,
    gpu: Res<GpuStatus>,
    palettes: Res<Palettes>,
    extraction: Res<PaletteExtraction>,
) {
    // Many props share few fields. The map's memory is reused.
    states.clear();
    for ((entity, prop), (posterize, recolor), (own, kept), mut state, mut progress, mut drawn) in &mut props {
        let id = prop.0.id();
        let before = before_palette(posterize, recolor);
        let data = states.entry((id, before.is_some())).or_insert_with(|| {
            let field = field_state(id, &fields, &server, &gpu);
            if field != PropState::Ready || before.is_none() || palettes.get(id).is_some() {
                return field;
            }
            match extraction.error(id) {
                Some(error) => PropState::Failed(PropError::Palette(error.clone())),
                None => PropState::AwaitingPalette,
            }
        });
        let is_drawn = match data {
            PropState::Ready | PropState::Failed(PropError::Palette(_)) => true,
            PropState::AwaitingPalette => before == Some(BeforePalette::AsTrained),
            _ => false,
        };
        if is_drawn && drawn.field.as_ref() != Some(&prop.0) {
            *drawn = DrawnField { field: Some(prop.0.clone()), since: gpu.frame() };
        } else if *data == PropState::Ready && !matches!(*state, PropState::Ready | PropState::Compiling) {
            // Its bounds do not change.
            drawn.bypass_change_detection().since = gpu.frame();
        }
        if drawn.field.as_ref() == Some(&prop.0) {
            match (own, kept) {
                (Some(own), Some(mut kept)) if kept.0 != *own => kept.0 = own.clone(),
                (Some(own), None) => _ = commands.entity(entity).try_insert(DrawnOverride(own.clone())),
                (None, Some(mut kept)) => kept.0.reset(),
                (Some(_), Some(_)) | (None, None) => {}
            }
        }
        let new = match data {
            PropState::Ready => match gpu.pipeline_error() {
                Some(error) => PropState::Failed(PropError::Pipeline(error.into())),
                None if *state == PropState::Ready || gpu.has_drawn(drawn.since) => PropState::Ready,
                None => PropState::Compiling,
            },
            other => other.clone(),
        };
        let palette = before.map(|_| match palettes.get(id) {
            Some(_) => 1.0,
            None => extraction.progress(id).unwrap_or(0.0),
        });
        let before = if state.is_waiting() && !prop.is_changed() { *progress } else { PropProgress::default() };
        let now = match new {
            PropState::Ready | PropState::Failed(_) => {
                PropProgress { read: 1.0, uploaded: 1.0, palette: palette.map(|_| 1.0) }
            }
            PropState::Loading => {
                let read = prop.0.path().and_then(|path| files.share(path)).unwrap_or(0.0);
                PropProgress { read, uploaded: 0.0, palette }
            }
            _ => PropProgress { read: 1.0, uploaded: gpu.progress(id), palette },
        };
        // A few frames pass between the end of reading and the arrival of the asset, and sampling may start again on another
        // processor.
        progress.set_if_neq(now.max(before));
        state.set_if_neq(new);
    }
}

/// Returns the state of a prop that needs no palette and whose pipelines are compiled.
fn field_state(
    id: AssetId<PlenOctree>,
    fields: &Assets<PlenOctree>,
    server: &AssetServer,
    gpu: &GpuStatus,
) -> PropState {
    // After a failed hot reload, the earlier version still exists.
    if !fields.contains(id) {
        return match server.get_load_state(id) {
            Some(LoadState::Failed(error)) => PropState::Failed(PropError::of_loader(&error)),
            _ => PropState::Loading,
        };
    }
    match gpu.outcome(id) {
        None => PropState::Uploading,
        Some(Ok(())) => PropState::Ready,
        Some(Err(error)) => PropState::Failed(PropError::TooLarge(error.clone())),
    }
}
