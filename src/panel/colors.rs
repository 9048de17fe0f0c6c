//! The colors that a prop shows, and the widget that edits one.

use bevy::prelude::*;
use bevy_egui::egui;

use plenoctree::palette::Palette;

use super::editor::source_color;
use crate::palette::{FieldPalette, PaletteOverride, decoded, encoded};

/// The palette of a prop's field, and the colors that the prop shows.
pub(super) struct Colors<'a> {
    pub(super) palette: &'a FieldPalette,
    pub(super) shown: Vec<Color>,
    /// Whether the prop overrides colors of the field.
    pub(super) is_own: bool,
    total: f64,
}

impl<'a> Colors<'a> {
    pub(super) fn new(palette: &'a FieldPalette, own: Option<&PaletteOverride>) -> Self {
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

    pub(super) fn any_edited(&self) -> bool {
        (0..self.shown.len()).any(|index| self.is_edited(index))
    }
}

/// Shows a color that can be edited and returns the new color if the user edited it.
pub(super) fn edit_swatch(ui: &mut egui::Ui, color: Color, size: egui::Vec2) -> egui::InnerResponse<Option<Color>> {
    ui.scope(|ui| {
        ui.spacing_mut().interact_size = size;
        let mut channels = bytes(color);
        let button = ui.color_edit_button_srgb(&mut channels);
        let [r, g, b] = channels;
        let edited = button.changed().then(|| Color::srgb_u8(r, g, b));
        egui::InnerResponse::new(edited, button.on_hover_text(format!("{} (click to edit)", hex(color))))
    })
    .inner
}

pub(super) fn bytes(color: Color) -> [u8; 3] {
    Srgba::from(color).to_u8_array_no_alpha()
}

pub(super) fn hex(color: Color) -> String {
    let [r, g, b] = bytes(color);
    format!("#{r:02x}{g:02x}{b:02x}")
}
