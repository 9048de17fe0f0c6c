//! Finds out what an app without a window is waiting for.

use bevy::{
    asset::LoadState,
    prelude::*,
    render::{RenderApp, render_asset::RenderAssets, render_resource::PipelineCache},
};
use plenoctree::PlenOctree;

use super::error::{HeadlessError, RenderingFailure};
use crate::{
    camera::PosterizeView,
    gpu::{GpuField, LeftOut, Readiness, pipelines},
    palette::{PaletteExtraction, Palettes, field_name},
    posterize::Posterize,
    prop::{Prop, PropError, PropState},
    render::PropView,
};

/// Returns which field or palette the scene waits for, or `None` if all are there. Fails if waiting does not help.
pub(super) fn for_data(app: &mut App) -> Result<Option<String>, HeadlessError> {
    check_rendering(app)?;
    for_pipelines(app)?;
    Ok(for_props(app.world_mut(), false)?.or(for_views(app.world_mut())?).or_else(|| for_arrivals(app)))
}

/// Returns what a scene with all fields and palettes waits for, or `None` if everything can be drawn. Only frames that
/// are drawn request pipelines.
pub(super) fn for_drawing(app: &mut App) -> Result<Option<String>, HeadlessError> {
    Ok(for_props(app.world_mut(), true)?.or(for_pipelines(app)?))
}

/// Returns what a frame that was just rendered waits for, or `None` if it is complete.
pub(super) fn for_frame(app: &App) -> Result<Option<String>, HeadlessError> {
    check_rendering(app)?;
    Ok(for_pipelines(app)?.or_else(|| for_arrivals(app)).or_else(|| for_levels(app)))
}

/// Returns whether another frame would change nothing, because what it waits for is being made in the background.
pub(super) fn rests(app: &App) -> bool {
    let render = app.get_sub_app(RenderApp);
    let fields = render.and_then(|render| render.world().get_resource::<RenderAssets<GpuField>>());
    fields.is_some_and(|fields| {
        let is_busy = fields.iter().any(|(_, field)| field.threads() > 0);
        is_busy && fields.iter().all(|(_, field)| field.awaits_threads())
    })
}

fn check_rendering(app: &App) -> Result<(), HeadlessError> {
    if let Some(RenderingFailure(reason)) = app.world().get_resource() {
        return Err(HeadlessError::Rendering(reason.clone()));
    }
    let Some(render) = app.get_sub_app(RenderApp) else { return Ok(()) };
    let views = render.world().try_query::<&PropView>();
    let shortage = views.and_then(|mut views| views.iter(render.world()).find_map(PropView::shortage).cloned());
    shortage.map_or(Ok(()), |shortage| Err(HeadlessError::View(shortage)))
}

fn for_arrivals(app: &App) -> Option<String> {
    let fields = app.get_sub_app(RenderApp)?.world().get_resource::<RenderAssets<GpuField>>()?;
    let (field, _) = fields.iter().find(|(_, field)| field.is_arriving())?;
    Some(format!("{} to reach the GPU", name(app.world(), field)))
}

fn for_pipelines(app: &App) -> Result<Option<String>, HeadlessError> {
    let render = app.get_sub_app(RenderApp);
    let Some(cache) = render.and_then(|render| render.world().get_resource::<PipelineCache>()) else {
        return Ok(None);
    };
    if let Some((label, error)) = pipelines::failed(cache).next() {
        return Err(HeadlessError::Prop(PropError::Pipeline(format!("{label}: {error}"))));
    }
    let waiting = pipelines::waiting(cache).next().map(|label| format!("the shaders of {label}"));
    let readiness = render.and_then(|render| render.world().get_resource::<Readiness>());
    let is_complete = readiness.is_none_or(|readiness| readiness.left_out == LeftOut::Nothing);
    Ok(waiting.or_else(|| (!is_complete).then(|| "a frame with all pipelines".to_string())))
}

fn for_levels(app: &App) -> Option<String> {
    let fields = app.get_sub_app(RenderApp)?.world().get_resource::<RenderAssets<GpuField>>()?;
    let (field, _) = fields.iter().find(|(_, field)| field.has_pending_levels())?;
    Some(format!("a level of {}", name(app.world(), field)))
}

/// Props wait for pipelines, or for everything else.
fn for_props(world: &mut World, for_pipelines: bool) -> Result<Option<String>, HeadlessError> {
    let mut props = world.query::<(&Prop, &PropState)>();
    let mut waits = None;
    for (prop, state) in props.iter(world) {
        let what = match state {
            PropState::Failed(error) => return Err(HeadlessError::Prop(error.clone())),
            PropState::Ready => continue,
            _ if for_pipelines != (*state == PropState::Compiling) => continue,
            PropState::Loading => "to be loaded",
            PropState::Uploading => "to reach the GPU",
            PropState::AwaitingPalette => "to get a palette",
            PropState::Compiling => "to get pipelines",
        };
        waits.get_or_insert((prop.0.id(), what));
    }
    Ok(waits.map(|(field, what)| format!("{} {what}", name(world, field))))
}

fn for_views(world: &mut World) -> Result<Option<String>, HeadlessError> {
    let mut views = world.query_filtered::<&PosterizeView, With<Posterize>>();
    let Some(palettes) = world.get_resource::<Palettes>() else { return Ok(None) };
    let missing: Vec<_> = views.iter(world).map(|view| view.0.id()).filter(|id| palettes.get(*id).is_none()).collect();
    let Some(id) = missing.first() else { return Ok(None) };
    if let Some(error) = world.get_resource::<PaletteExtraction>().and_then(|extraction| extraction.error(*id)) {
        return Err(HeadlessError::Prop(PropError::Palette(error.clone())));
    }
    match world.get_resource::<AssetServer>().and_then(|server| server.get_load_state(*id)) {
        Some(LoadState::Failed(error)) => Err(HeadlessError::Prop(PropError::of_loader(&error))),
        _ => Ok(Some(format!("{} to get a palette", name(world, *id)))),
    }
}

/// Returns the path of a field or, if it has none, its id.
fn name(world: &World, field: AssetId<PlenOctree>) -> String {
    field_name(world.resource(), field)
}
