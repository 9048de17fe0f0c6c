//! The panel's contents.

use bevy::{asset::LoadState, prelude::*};
use bevy_egui::egui;
use plenoctree::PlenOctree;

use super::{editor::PaletteEditor, extraction, posterize, swatches};
use crate::prop::PropError;

/// Shows widgets that edit the palette of the entity `prop`, its [`Posterize`](crate::Posterize) settings, and the
/// extraction of the palette.
///
/// Call it from a system in bevy_egui's `EguiPrimaryContextPass`. It triggers change detection only for what the user
/// edits. If the entity is not a [`Prop`](crate::Prop), it shows a note.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_egui::{EguiContexts, egui};
/// # use bevy_plenoctree::{Prop, panel::{PaletteEditor, palette_ui}};
/// // A system in `EguiPrimaryContextPass`.
/// fn my_tools(mut contexts: EguiContexts, mut editor: PaletteEditor, prop: Single<Entity, With<Prop>>) -> Result {
///     egui::Window::new("My tools").show(contexts.ctx_mut()?, |ui| palette_ui(ui, *prop, &mut editor));
///     Ok(())
/// }
/// ```
pub fn palette_ui(ui: &mut egui::Ui, prop: Entity, editor: &mut PaletteEditor) {
    let Some(field) = editor.field(prop) else {
        ui.weak("This entity is not a prop.");
        return;
    };
    ui.push_id(prop, |ui| {
        if !editor.fields.contains(field) {
            loading(ui, field, editor);
            return;
        }
        swatches::show(ui, prop, field, editor);
        ui.separator();
        posterize::show(ui, prop, editor);
        ui.separator();
        extraction::show(ui, field, editor);
    });
}

fn loading(ui: &mut egui::Ui, field: AssetId<PlenOctree>, editor: &PaletteEditor) {
    match editor.server.as_ref().and_then(|server| server.get_load_state(field)) {
        Some(LoadState::Failed(error)) => {
            ui.colored_label(ui.visuals().error_fg_color, PropError::of_loader(&error).to_string());
        }
        Some(LoadState::Loading) => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label("Loading the field...");
            });
        }
        _ => {
            ui.weak("The prop's field is not loaded.");
        }
    }
}
