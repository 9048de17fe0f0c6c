//! The panel in a window of its own.

use bevy::prelude::*;
use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, egui};

use super::{contents::palette_ui, editor::PaletteEditor};
use crate::prop::Prop;

/// Shows the palette and the look of one prop in an egui window, to change them.
///
/// Adds `EguiPlugin` if it is missing: an app that adds it itself does so first. Needs
/// [`PlenOctreePlugin`](crate::PlenOctreePlugin).
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
///     panel.prop = Some(commands.spawn((Prop(server.load("drum.npz")), Posterize::default())).id());
/// }
/// ```
pub struct PalettePanelPlugin;

impl Plugin for PalettePanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin::default());
        }
        app.init_resource::<PalettePanel>().add_systems(EguiPrimaryContextPass, show);
    }
}

/// What [`PalettePanelPlugin`]'s window shows.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub struct PalettePanel {
    /// The entity with the [`Prop`] that is looked at. While there is none, the window shows the only prop there is, or
    /// asks which one.
    pub prop: Option<Entity>,
    /// Whether the window is there. The user can close it.
    pub open: bool,
}

impl Default for PalettePanel {
    fn default() -> Self {
        Self { prop: None, open: true }
    }
}

fn show(
    mut contexts: EguiContexts,
    mut panel: ResMut<PalettePanel>,
    mut editor: PaletteEditor,
    props: Query<(Entity, Option<&Name>), With<Prop>>,
) {
    // Without a camera there is no context yet.
    let Ok(context) = contexts.ctx_mut() else {
        return;
    };
    let mut chosen = *panel;
    chosen.prop = panel.prop.filter(|prop| props.contains(*prop)).or(props.single().ok().map(|(prop, _)| prop));
    let window = egui::Window::new("Palette").open(&mut chosen.open).default_size([300.0, 640.0]).vscroll(true);
    window.show(context, |ui| {
        if props.iter().len() > 1 {
            choose(ui, &mut chosen.prop, &props);
        }
        match chosen.prop {
            Some(prop) => palette_ui(ui, prop, &mut editor),
            None => {
                ui.weak("No prop is selected.");
            }
        }
    });
    panel.set_if_neq(chosen);
}

fn choose(ui: &mut egui::Ui, chosen: &mut Option<Entity>, props: &Query<(Entity, Option<&Name>), With<Prop>>) {
    let label = |prop| match props.get(prop) {
        Ok((_, Some(name))) => name.to_string(),
        _ => format!("prop {prop}"),
    };
    egui::ComboBox::from_id_salt("prop").selected_text(chosen.map_or("choose a prop".into(), label)).show_ui(
        ui,
        |ui| {
            for (prop, _) in props {
                ui.selectable_value(chosen, Some(prop), label(prop));
            }
        },
    );
}
