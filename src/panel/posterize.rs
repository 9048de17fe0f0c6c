//! The settings of [`Posterize`].

use bevy::prelude::*;
use bevy_egui::egui;

use super::editor::PaletteEditor;
use crate::posterize::{BilateralFilter, MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS, Posterize};

pub(super) fn show(ui: &mut egui::Ui, prop: Entity, editor: &mut PaletteEditor) {
    let posterized = editor.is_posterized(prop);
    ui.horizontal(|ui| {
        let mut wanted = posterized;
        let hint = "Whether the prop is shown in the colors of its palette or as it was trained";
        if ui.checkbox(&mut wanted, egui::RichText::new("Posterize").strong()).on_hover_text(hint).changed() {
            editor.set_posterized(prop, wanted);
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let differs = posterized && editor.posterize(prop) != Posterize::default();
            if ui.add_enabled(differs, egui::Button::new("Defaults")).clicked() {
                editor.set_posterize(prop, Posterize::default());
            }
        });
    });
    let mut settings = editor.posterize(prop);
    if ui.add_enabled_ui(posterized, |ui| sliders(ui, &mut settings)).inner {
        editor.set_posterize(prop, settings);
    }
}

/// Returns whether the user changed something.
fn sliders(ui: &mut egui::Ui, settings: &mut Posterize) -> bool {
    let Posterize { blend_steps, softness, min_opacity, filter } = settings;
    let BilateralFilter { iterations, radius, spatial_sigma, range_sigma } = filter;
    let labels = egui::Grid::new("labels").num_columns(2).show(ui, |ui| {
        let hint = "Steps from one palette color to another; 1 is the palette colors alone";
        let steps = row(ui, "Blend steps", hint, egui::Slider::new(blend_steps, 1..=8));
        let hint = "Distance in RGB over which neighboring colors blend; 0 is a hard edge";
        let softness = row(ui, "Softness", hint, egui::Slider::new(softness, 0.0..=0.4));
        let hint = "Pixels with less opacity are shown as trained";
        let opacity = row(ui, "Min. opacity", hint, egui::Slider::new(min_opacity, 0.0..=1.0));
        steps | softness | opacity
    });
    let filter = egui::CollapsingHeader::new("Filter").show(ui, |ui| {
        egui::Grid::new("filter").num_columns(2).show(ui, |ui| {
            let hint = "How often the bilateral filter runs; 0 is no filter";
            let iterations = row(ui, "Iterations", hint, egui::Slider::new(iterations, 0..=MAX_FILTER_ITERATIONS));
            let hint = "Radius of the filter in pixels";
            let radius = row(ui, "Radius", hint, egui::Slider::new(radius, 0..=MAX_FILTER_RADIUS));
            let hint = "Spatial sigma in pixels";
            let spatial = row(ui, "Spatial sigma", hint, egui::Slider::new(spatial_sigma, 0.5..=10.0));
            let hint = "Range sigma in CIELAB: colors further apart are kept apart";
            let range = row(ui, "Range sigma", hint, egui::Slider::new(range_sigma, 0.5..=30.0).logarithmic(true));
            iterations | radius | spatial | range
        })
    });
    labels.inner | filter.body_returned.is_some_and(|grid| grid.inner)
}

/// One row of a grid of settings; returns whether the user changed the value. Values that are out of the slider's range
/// stay as they are until then.
pub(super) fn row(ui: &mut egui::Ui, label: &str, hint: &str, slider: egui::Slider) -> bool {
    ui.label(label).on_hover_text(hint);
    let changed = ui.add(slider.clamping(egui::SliderClamping::Edits)).on_hover_text(hint).changed();
    ui.end_row();
    changed
}
