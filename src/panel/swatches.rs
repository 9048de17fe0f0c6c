//! The section of the panel that shows and edits the palette's colors.

use bevy::prelude::*;
use bevy_egui::egui;

use plenoctree::PlenOctree;

use super::editor::{Edit, PaletteEditor, source_color};
use crate::palette::{FieldPalette, PaletteOverride};

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
                edit = Some(Edit::ResetAll);
            }
        });
    });
    match &colors {
        Some(colors) => edit = grid(ui, colors).or(edit),
        None => {
            ui.weak("No palette yet. Posterize the prop to get one.");
        }
    }
    // Borrowed mutably only if there is an edit, so that showing the panel does not trigger change detection.
    if let Some(edit) = edit {
        editor.recolor(prop, field, edit);
    }
    let hint = "Edits colors for this prop only, not for all props of the same field";
    if ui.checkbox(&mut overridden, "Override colors").on_hover_text(hint).changed() {
        editor.set_own_colors(prop, overridden);
    }
}

/// The palette of a prop's field, and the colors that the prop shows.
struct Colors<'a> {
    palette: &'a FieldPalette,
    shown: Vec<Color>,
    /// Whether the prop overrides colors of the field.
    is_own: bool,
}

impl<'a> Colors<'a> {
    fn new(palette: &'a FieldPalette, own: Option<&PaletteOverride>) -> Self {
        let shown = own.map_or_else(|| palette.shown().to_vec(), |own| own.shown(palette));
        Self { palette, shown, is_own: own.is_some() }
    }

    /// Returns whether there is something to reset.
    fn is_edited(&self, index: usize) -> bool {
        let before = if self.is_own { self.palette.shown()[index] } else { source_color(self.palette, index) };
        self.shown[index] != before
    }

    fn any_edited(&self) -> bool {
        (0..self.shown.len()).any(|index| self.is_edited(index))
    }
}

/// Shows a grid of the palette's colors and returns the user's edit, if any.
fn grid(ui: &mut egui::Ui, colors: &Colors) -> Option<Edit> {
    let mut edit = None;
    let weights = &colors.palette.palette().weights;
    let total: f64 = weights.iter().sum();
    egui::Grid::new("swatches").num_columns(5).min_col_width(0.0).show(ui, |ui| {
        for heading in ["", "source", "shown", "weight"] {
            ui.weak(heading);
        }
        ui.end_row();
        for index in 0..colors.shown.len() {
            ui.weak(index.to_string());
            swatch(ui, source_color(colors.palette, index));
            if let Some(color) = edit_swatch(ui, colors.shown[index]) {
                edit = Some(Edit::Set(index, color));
            }
            let weight = weights.get(index).copied().unwrap_or_default();
            let share = if total > 0.0 { 100.0 * weight / total } else { 0.0 };
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.label(format!("{share:.1}%")));
            if ui.add_enabled(colors.is_edited(index), egui::Button::new("Reset").small()).clicked() {
                edit = Some(Edit::Reset(index));
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

/// Shows a color that can be edited and returns the new color if the user edited it.
fn edit_swatch(ui: &mut egui::Ui, color: Color) -> Option<Color> {
    ui.scope(|ui| {
        ui.spacing_mut().interact_size = SWATCH;
        let mut channels = bytes(color);
        let button = ui.color_edit_button_srgb(&mut channels);
        let [r, g, b] = channels;
        let changed = button.changed();
        button.on_hover_text(format!("{} (click to edit)", hex(color)));
        changed.then(|| Color::srgb_u8(r, g, b))
    })
    .inner
}

fn bytes(color: Color) -> [u8; 3] {
    Srgba::from(color).to_u8_array_no_alpha()
}

fn hex(color: Color) -> String {
    let [r, g, b] = bytes(color);
    format!("#{r:02x}{g:02x}{b:02x}")
}
