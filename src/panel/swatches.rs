//! The section of the panel that shows and edits the palette's colors.

use bevy::prelude::*;
use bevy_egui::egui;

use plenoctree::{PlenOctree, palette::Palette};

use super::{
    editor::{Edit, PaletteEditor, source_color},
    ramps,
};
use crate::palette::{FieldPalette, PaletteOverride, decoded, encoded};

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
        Some(colors) if colors.palette.ramps().is_empty() => edit = grid(ui, colors).or(edit),
        Some(colors) => edit = ramps::rows(ui, colors).or(edit),
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

/// The palette of a prop's field, and the colors that the prop shows.
pub(super) struct Colors<'a> {
    pub(super) palette: &'a FieldPalette,
    pub(super) shown: Vec<Color>,
    /// Whether the prop overrides colors of the field.
    pub(super) is_own: bool,
    total: f64,
}

impl<'a> Colors<'a> {
    fn new(palette: &'a FieldPalette, own: Option<&PaletteOverride>) -> Self {
        let shown = own.map_or_else(|| palette.shown().to_vec(), |own| own.shown(palette));
        Self { palette, shown, is_own: own.is_some(), total: palette.palette().weights.iter().sum() }
    }

    /// Returns the mean of the colors that a ramp shows.
    pub(super) fn ramp_color(&self, ramp: usize) -> Color {
        let colors = self.shown.iter().map(|color| encoded(*color)).collect();
        let shown = Palette { colors, ..self.palette.palette().clone() };
        shown.ramp_color(ramp).map_or(Color::BLACK, |color| decoded(&color))
    }

    /// Returns the share of a color in the weight of all, in percent.
    pub(super) fn share(&self, index: usize) -> f64 {
        let weight = self.palette.palette().weights.get(index).copied().unwrap_or_default();
        if self.total > 0.0 { 100.0 * weight / self.total } else { 0.0 }
    }

    /// Returns whether there is something to reset.
    pub(super) fn is_edited(&self, index: usize) -> bool {
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
    egui::Grid::new("swatches").num_columns(5).min_col_width(0.0).show(ui, |ui| {
        for heading in ["", "source", "shown", "weight"] {
            ui.weak(heading);
        }
        ui.end_row();
        for index in 0..colors.shown.len() {
            ui.weak(index.to_string());
            swatch(ui, source_color(colors.palette, index));
            if let Some(color) = edit_swatch(ui, colors.shown[index], SWATCH) {
                edit = Some(Edit::Set(index, color));
            }
            let share = format!("{:.1}%", colors.share(index));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.label(share));
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
pub(super) fn edit_swatch(ui: &mut egui::Ui, color: Color, size: egui::Vec2) -> Option<Color> {
    ui.scope(|ui| {
        ui.spacing_mut().interact_size = size;
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
