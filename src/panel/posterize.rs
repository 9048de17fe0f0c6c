//! The section of the panel that edits [`Posterize`].

use bevy::prelude::*;
use bevy_egui::egui;

use super::editor::PaletteEditor;
use crate::posterize::{
    BilateralFilter, BorderSmoothing, EdgeSmoothing, MAX_BLEND_STEPS, MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS,
    Posterize,
};

pub(super) fn show(ui: &mut egui::Ui, prop: Entity, editor: &mut PaletteEditor) {
    let posterized = editor.is_posterized(prop);
    ui.horizontal(|ui| {
        let mut enabled = posterized;
        let hint = "Draws the prop in the colors of its palette instead of as trained";
        if ui.checkbox(&mut enabled, egui::RichText::new("Posterize").strong()).on_hover_text(hint).changed() {
            editor.set_posterized(prop, enabled);
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let edited = posterized && editor.posterize(prop) != Posterize::default();
            if ui.add_enabled(edited, egui::Button::new("Defaults")).clicked() {
                editor.set_posterize(prop, Posterize::default());
            }
        });
    });
    let mut settings = editor.posterize(prop);
    if ui.add_enabled_ui(posterized, |ui| sliders(ui, &mut settings)).inner {
        editor.set_posterize(prop, settings);
    }
}

/// Shows the settings and returns whether the user changed a value.
fn sliders(ui: &mut egui::Ui, settings: &mut Posterize) -> bool {
    let Posterize {
        blend_steps,
        softness,
        min_opacity,
        filter,
        before_palette: _,
        edges,
        borders,
        steadiness: _,
        method: _,
    } = settings;
    let BilateralFilter { iterations, radius, taps, spatial_sigma, range_sigma } = filter;
    let labels = egui::Grid::new("labels").num_columns(2).show(ui, |ui| {
        let hint = "Steps from one palette color to another; 1 disables blends, which tones never have";
        let steps = row(ui, "Blend steps", hint, egui::Slider::new(blend_steps, 1..=MAX_BLEND_STEPS));
        let hint = "Distance in color over which neighboring labels blend; 0 is a hard edge";
        let softness = row(ui, "Softness", hint, egui::Slider::new(softness, 0.0..=0.4));
        let hint = "Pixels below this opacity are drawn as trained";
        let opacity = row(ui, "Min. opacity", hint, egui::Slider::new(min_opacity, 0.0..=1.0));
        steps | softness | opacity
    });
    let mut smooth = *edges == EdgeSmoothing::Coverage;
    let hint = "Blends the edges of the prop with what is behind them";
    let switched = ui.checkbox(&mut smooth, "Smooth edges").on_hover_text(hint).changed();
    if switched {
        *edges = if smooth { EdgeSmoothing::Coverage } else { EdgeSmoothing::Off };
    }
    let mut smooth = *borders == BorderSmoothing::Interpolated;
    let hint = "Smooths the borders between hard labels: those of softness 0";
    let switched = switched | ui.checkbox(&mut smooth, "Smooth borders").on_hover_text(hint).changed();
    if switched {
        *borders = if smooth { BorderSmoothing::Interpolated } else { BorderSmoothing::Off };
    }
    let filter = egui::CollapsingHeader::new("Filter").show(ui, |ui| {
        egui::Grid::new("filter").num_columns(2).show(ui, |ui| {
            let hint = "Iterations of the bilateral filter; 0 disables it";
            let iterations = row(ui, "Iterations", hint, egui::Slider::new(iterations, 0..=MAX_FILTER_ITERATIONS));
            let hint = "Radius of the filter, in pixels";
            let radius = row(ui, "Radius", hint, egui::Slider::new(radius, 0..=MAX_FILTER_RADIUS));
            let hint = "Pixels that it reads on each side, spread over the radius";
            let taps = row(ui, "Taps", hint, egui::Slider::new(taps, 1..=MAX_FILTER_RADIUS));
            let hint = "Spatial sigma, in pixels";
            let spatial = row(ui, "Spatial sigma", hint, egui::Slider::new(spatial_sigma, 0.5..=10.0));
            let hint = "Range sigma, in CIELAB; larger color differences are kept as edges";
            let range = row(ui, "Range sigma", hint, egui::Slider::new(range_sigma, 0.5..=30.0).logarithmic(true));
            iterations | radius | taps | spatial | range
        })
    });
    labels.inner | switched | filter.body_returned.is_some_and(|grid| grid.inner)
}

/// Adds a row to a grid of settings and returns whether the user changed the value. Values outside the slider's range
/// are kept until the user changes them.
pub(super) fn row(ui: &mut egui::Ui, label: &str, hint: &str, slider: egui::Slider) -> bool {
    ui.label(label).on_hover_text(hint);
    let changed = ui.add(slider.clamping(egui::SliderClamping::Edits)).on_hover_text(hint).changed();
    ui.end_row();
    changed
}
