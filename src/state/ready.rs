//! Whether all props are ready, and how far they are from it.

use bevy::{asset::LoadState, platform::collections::HashMap, prelude::*};
use plenoctree::PlenOctree;

use crate::{
    camera::PosterizeView,
    palette::{PaletteExtraction, Palettes},
    posterize::Posterize,
    prop::{Prop, PropProgress, PropState},
};

/// A run condition: returns whether no prop is waiting for its field, its palette or its pipelines, and no
/// [posterized view](PosterizeView) for its palette.
///
/// Props that have [failed](PropState::Failed) do not count, because they would never let a loading screen end. Nor do
/// views whose palette could not be extracted, or whose field could not be loaded. Returns true if there are no props
/// and no such views. A prop that was spawned in this frame is waiting, even if its field is on the GPU. One that was
/// given another field in this frame counts as before until the next frame.
pub fn props_ready(
    props: Query<&PropState, With<Prop>>,
    views: Query<&PosterizeView, With<Posterize>>,
    palettes: Res<Palettes>,
    extraction: Res<PaletteExtraction>,
    server: Res<AssetServer>,
) -> bool {
    !props.iter().any(PropState::is_waiting)
        && views.iter().all(|view| palette_progress(view.0.id(), &palettes, &extraction, &server) == 1.0)
}

/// Returns how far the palette of a field is, from 0 to 1. It is 1 if there will be none.
fn palette_progress(
    field: AssetId<PlenOctree>,
    palettes: &Palettes,
    extraction: &PaletteExtraction,
    server: &AssetServer,
) -> f32 {
    let is_known = palettes.get(field).is_some() || extraction.error(field).is_some();
    if is_known || matches!(server.get_load_state(field), Some(LoadState::Failed(_))) {
        return 1.0;
    }
    // Its last step takes a frame.
    extraction.progress(field).unwrap_or(0.0).min(0.99)
}

/// A system that returns how much of all fields is ready to be drawn, from 0 to 1, for loading screens: the mean of
/// their [fractions](PropProgress::fraction). Each field counts once, however many props show it, with the lowest
/// fraction of these props. Of a field that only posterized views show, the palette counts. Returns 1 if there are no
/// props and no such views. Pipelines that are being compiled do not count: they take a few frames at the end.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, props_progress, props_ready};
/// # #[derive(Component)]
/// # struct LoadingBar;
/// fn show_progress(In(progress): In<f32>, mut bars: Query<&mut Transform, With<LoadingBar>>) {
///     for mut bar in &mut bars {
///         bar.scale.x = progress;
///     }
/// }
///
/// fn plugin(app: &mut App) {
///     app.add_systems(Update, props_progress.pipe(show_progress).run_if(not(props_ready)));
/// }
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin, plugin)).update();
/// ```
pub fn props_progress(
    props: Query<(&Prop, &PropProgress)>,
    views: Query<&PosterizeView, With<Posterize>>,
    palettes: Res<Palettes>,
    extraction: Res<PaletteExtraction>,
    server: Res<AssetServer>,
    mut fields: Local<HashMap<AssetId<PlenOctree>, f32>>,
) -> f32 {
    fields.clear();
    for (prop, progress) in &props {
        let least = fields.entry(prop.0.id()).or_insert(1.0);
        *least = least.min(progress.fraction());
    }
    for id in views.iter().map(|view| view.0.id()) {
        fields.entry(id).or_insert_with(|| palette_progress(id, &palettes, &extraction, &server));
    }
    let sum: f32 = fields.values().sum();
    if fields.is_empty() { 1.0 } else { sum / fields.len() as f32 }
}
