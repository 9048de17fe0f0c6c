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
    /// What the prop overrides of the palette, if edits are for the prop alone.
    pub(super) own: Option<&'a PaletteOverride>,
}

impl<'a> Colors<'a> {
    pub(super) fn new(palette: &'a FieldPalette, own: Option<&'a PaletteOverride>) -> Self {
        let shown = own.map_or_else(|| palette.shown().to_vec(), |own| own.shown(palette));
        Self { palette, shown, own }
    }

    /// Returns the mean of the colors that a ramp shows.
    pub(super) fn ramp_color(&self, ramp: usize) -> Color {
        let colors = self.shown.iter().map(|color| encoded(*color)).collect();
        let shown = Palette { colors, ..self.palette.palette().clone() };
        shown.ramp_color(ramp).map_or(Color::BLACK, |color| decoded(&color))
    }

    /// Returns the share of a color in the weight of all, in percent.
    pub(super) fn share(&self, index: usize) -> f64 {
        100.0 * self.palette.palette().share(index)
    }

    /// Returns whether there is something to reset.
    pub(super) fn is_edited(&self, index: usize) -> bool {
        match self.own {
            Some(own) => own.get(index).is_some(),
            None => self.shown[index] != source_color(self.palette, index),
        }
    }

    /// Returns whether there is something of a ramp to reset.
    pub(super) fn is_ramp_edited(&self, ramp: usize) -> bool {
        let ramp = &self.palette.ramps()[ramp];
        let is_own = self.own.is_some_and(|own| own.ramp(&ramp.name).is_some());
        is_own || ramp.tones.iter().any(|tone| self.is_edited(*tone))
    }

    pub(super) fn any_edited(&self) -> bool {
        match self.own {
            Some(own) => !own.is_empty(),
            None => (0..self.shown.len()).any(|index| self.is_edited(index)),
        }
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
