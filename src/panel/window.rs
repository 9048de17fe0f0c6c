//! A window that shows the panel.

use bevy::prelude::*;
use bevy_egui::{
    EguiContext, EguiContexts, EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass, EguiSchedule,
    PrimaryEguiContext, egui,
};

use super::{contents::palette_ui, editor::PaletteEditor};
use crate::prop::Prop;

/// A plugin that shows an egui window to edit the palette and settings of a prop.
///
/// The resource [`PalettePanel`] selects the prop. Requires [`PlenOctreePlugin`](crate::PlenOctreePlugin). Adds
/// `EguiPlugin` if it is missing; if your app adds `EguiPlugin` itself, it must do so before adding this plugin.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, Posterize, Prop, panel::{PalettePanel, PalettePanelPlugin}};
/// fn main() {
///     App::new()
///         .add_plugins((DefaultPlugins, PlenOctreePlugin, PalettePanelPlugin))
///         .add_systems(Startup, setup)
///         .run();
/// }
///
/// fn setup(mut commands: Commands, server: Res<AssetServer>, mut panel: ResMut<PalettePanel>) {
///     commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y)));
///     panel.prop = Some(commands.spawn((Prop(server.load("drum.plenoctree")), Posterize::default())).id());
/// }
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct PalettePanelPlugin;

impl Plugin for PalettePanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<PalettePanel>().add_systems(First, choose_camera).add_systems(EguiPrimaryContextPass, show);
    }
}

/// Controls the window of [`PalettePanelPlugin`].
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub struct PalettePanel {
    /// The entity whose [`Prop`] is edited. If it is `None`, or not a prop, the window shows the only prop or, if there
    /// are several, lets the user choose. Only the user's choice changes it.
    ///
    /// Defaults to `None`.
    pub prop: Option<Entity>,
    /// The camera in whose view the window is shown. This makes it bevy_egui's primary context, so everything else that
    /// your app shows in `EguiPrimaryContextPass` moves there as well. If it is `None`, or not a camera, the window is
    /// shown in the existing primary context: that of the first camera and, once that is despawned, of an active one. If
    /// your app clears `EguiGlobalSettings::auto_create_primary_context` at the start, it chooses the primary context.
    ///
    /// Defaults to `None`.
    pub camera: Option<Entity>,
    /// Whether the window is open. The user can close it.
    ///
    /// Defaults to `true`.
    pub open: bool,
}

impl Default for PalettePanel {
    fn default() -> Self {
        Self { prop: None, camera: None, open: true }
    }
}

/// Makes the camera of the panel the primary context or, if there is none, an active one.
///
/// Replaces bevy_egui's own choice, which is made only once, and even if another camera has been chosen.
fn choose_camera(
    mut commands: Commands,
    panel: Res<PalettePanel>,
    mut settings: ResMut<EguiGlobalSettings>,
    mut is_automatic: Local<bool>,
    cameras: Query<(Entity, &Camera)>,
    primary: Query<Entity, With<PrimaryEguiContext>>,
) {
    if settings.auto_create_primary_context {
        settings.auto_create_primary_context = false;
        *is_automatic = true;
    }
    let chosen = panel.camera.filter(|camera| cameras.contains(*camera));
    let active = cameras.iter().find(|(_, camera)| camera.is_active).map(|(camera, _)| camera);
    let camera = chosen.or(active.filter(|_| *is_automatic && primary.is_empty()));
    let Some(camera) = camera.filter(|camera| !primary.contains(*camera)) else {
        return;
    };
    for other in &primary {
        commands.entity(other).remove::<(PrimaryEguiContext, EguiSchedule, EguiContext)>();
    }
    commands.entity(camera).insert(PrimaryEguiContext);
}

fn show(
    mut contexts: EguiContexts,
    mut panel: ResMut<PalettePanel>,
    mut editor: PaletteEditor,
    props: Query<(Entity, Option<&Name>), With<Prop>>,
) {
    // There is no context until there is a camera.
    let Ok(context) = contexts.ctx_mut() else {
        return;
    };
    let mut edited = *panel;
    // The chosen entity may become a prop later.
    let shown = panel.prop.filter(|prop| props.contains(*prop)).or(props.single().ok().map(|(prop, _)| prop));
    let window = egui::Window::new("Palette").open(&mut edited.open).default_size([300.0, 640.0]).vscroll(true);
    window.show(context, |ui| {
        let mut selected = shown;
        if props.iter().len() > 1 {
            select(ui, &mut selected, &props);
        }
        if selected != shown {
            edited.prop = selected;
        }
        match selected {
            Some(prop) => palette_ui(ui, prop, &mut editor),
            None => {
                ui.weak("No prop is selected.");
            }
        }
    });
    panel.set_if_neq(edited);
}

fn select(ui: &mut egui::Ui, selected: &mut Option<Entity>, props: &Query<(Entity, Option<&Name>), With<Prop>>) {
    let label = |prop| match props.get(prop) {
        Ok((_, Some(name))) => name.to_string(),
        _ => format!("prop {prop}"),
    };
    egui::ComboBox::from_id_salt("prop").selected_text(selected.map_or("Select a prop".into(), label)).show_ui(
        ui,
        |ui| {
            for (prop, _) in props {
                ui.selectable_value(selected, Some(prop), label(prop));
            }
        },
    );
}
