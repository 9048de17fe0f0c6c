//! The section of the panel that shows and edits the palette's colors.

use bevy::prelude::*;
use bevy_egui::egui;

use plenoctree::PlenOctree;

use super::{
    colors::{Colors, bytes, edit_swatch, hex},
    editor::{ColorEdit, Edit, PaletteEditor, source_color},
    ramps,
};

const SWATCH: egui::Vec2 = egui::vec2(64.0, 24.0);

pub(super) fn show(ui: &mut egui::Ui, prop: Entity, field: AssetId<PlenOctree>, editor: &mut PaletteEditor) {
    let mut edit = None;
    let mut overridden = editor.own_colors(prop).is_some();
    let colors = editor.palettes.get(field).map(|palette| Colors::new(palette, editor.own_colors(prop)));
    ui.horizontal(|ui| {
        ui.strong("Palette");
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let edited = colors.as_ref().is_some_and(Colors::any_edited);
            if ui.add_enabled(edited, egui::Button::new("Reset all")).clicked() {
                edit = Some(ColorEdit::ResetAll.into());
            }
        });
    });
    match &colors {
        Some(colors) => {
            edit = ramps::rows(ui, colors).or(edit);
            edit = grid(ui, colors).or(edit);
        }
        None => {
            ui.weak("No palette yet. Posterize the prop to get one.");
        }
    }
    // Borrowed mutably only if there is an edit, so that showing the panel does not trigger change detection.
    if let Some(edit) = edit {
        editor.edit(prop, field, edit);
    }
    let hint = "Edits colors for this prop only, not for all props of the same field. Ramps stay those of the field";
    if ui.checkbox(&mut overridden, "Override colors").on_hover_text(hint).changed() {
        editor.set_own_colors(prop, overridden);
    }
}

/// Shows a grid of the palette's colors that are in no ramp and returns the user's edit, if any.
fn grid(ui: &mut egui::Ui, colors: &Colors) -> Option<Edit> {
    let mut edit = None;
    let palette = colors.palette.palette();
    let indices: Vec<usize> = (0..colors.shown.len()).filter(|index| palette.ramp_of(*index).is_none()).collect();
    if indices.is_empty() {
        return None;
    }
    egui::Grid::new("swatches").num_columns(5).min_col_width(0.0).show(ui, |ui| {
        for heading in ["", "source", "shown", "weight"] {
            ui.weak(heading);
        }
        ui.end_row();
        for index in indices {
            ui.weak(index.to_string());
            swatch(ui, source_color(colors.palette, index));
            if let Some(color) = edit_swatch(ui, colors.shown[index], SWATCH).inner {
                edit = Some(ColorEdit::Set(index, color).into());
            }
            let share = format!("{:.1}%", colors.share(index));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.label(share));
            if ui.add_enabled(colors.is_edited(index), egui::Button::new("Reset").small()).clicked() {
                edit = Some(ColorEdit::Reset(index).into());
            }
            ui.end_row();
        }
    });
    edit
}

/// Shows a color.
fn swatch(ui: &mut egui::Ui, color: Color) {
    let [r, g, b] = bytes(color);
    egui::color_picker::show_color(ui, egui::Color32::from_rgb(r, g, b), SWATCH).on_hover_text(hex(color));
}
