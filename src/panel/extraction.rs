//! The extraction section of the panel: section 3 of the method.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{editor::PaletteEditor, posterize::row};
use plenoctree::{
    PlenOctree,
    palette::{ColorCount, ExtractionReport, ExtractionSettings, PaletteMethod},
    sampling::{ObserverRegion, SamplingSettings},
};

pub(super) fn show(ui: &mut egui::Ui, field: AssetId<PlenOctree>, editor: &mut PaletteEditor) {
    ui.strong("Extraction");
    if let Some(progress) = editor.extraction.progress(field) {
        ui.add(egui::ProgressBar::new(progress).show_percentage());
    }
    if let Some(error) = editor.extraction.error(field) {
        ui.colored_label(ui.visuals().error_fg_color, format!("Extraction failed: {error}"));
    }
    let palette = editor.palettes.get(field);
    if let Some(report) = palette.and_then(|palette| palette.extraction()) {
        let samples = editor.extraction.sampled(field);
        let origin = samples.map(|samples| format!(", sampled {}", samples.origin)).unwrap_or_default();
        ui.weak(format!("{}{origin}", summary(report)));
    } else if palette.is_some() {
        ui.weak("The palette was not extracted, but loaded or inserted.");
    }

    let mut settings = editor.extraction.settings.clone();
    let changed = egui::CollapsingHeader::new("Settings").show(ui, |ui| sliders(ui, &mut settings)).body_returned;
    if changed == Some(true) {
        editor.extraction.settings = settings;
    }
    let invalid = editor.extraction.settings.validate().err();
    let label = if palette.is_some() { "Extract again" } else { "Extract" };
    let button = ui.add_enabled(invalid.is_none(), egui::Button::new(label));
    if button.on_hover_text("Replaces the palette, including its shown colors").clicked() {
        editor.extraction.request(field);
    }
    if let Some(invalid) = invalid {
        ui.colored_label(ui.visuals().error_fg_color, invalid.to_string());
    }
}

fn summary(report: &ExtractionReport) -> String {
    let seconds = report.seconds;
    let clusters = report.clusters.map(|clusters| format!(", {clusters} clusters")).unwrap_or_default();
    format!(
        "{} radiance samples{clusters}, {:.1} s",
        rounded(report.radiance_samples),
        seconds.sampling + seconds.filtering + seconds.hull + seconds.fitting
    )
}

fn rounded(count: u64) -> String {
    match count {
        0..1_000 => count.to_string(),
        1_000..1_000_000 => format!("{:.1} k", count as f64 * 1e-3),
        _ => format!("{:.1} M", count as f64 * 1e-6),
    }
}

/// Shows the sliders and returns whether the user changed a value.
fn sliders(ui: &mut egui::Ui, settings: &mut ExtractionSettings) -> bool {
    let ExtractionSettings { sampling, coarse_threshold, method, colors, .. } = settings;
    let SamplingSettings { observers, directions, multisamples, sample_fraction, .. } = sampling;
    egui::Grid::new("extraction")
        .num_columns(2)
        .show(ui, |ui| {
            let hint = "hull: the corners of all colors; fitted: the colors whose blends fit best; tones: colors without \
                        blends";
            let method = choose(ui, "Method", hint, method, &PaletteMethod::ALL, PaletteMethod::name);
            let colors = choose_colors(ui, colors);
            let regions = [ObserverRegion::UpperHemisphere, ObserverRegion::Sphere];
            let hint = "Directions from which the field is seen";
            let observers = choose(ui, "Observers", hint, observers, &regions, observers_name);
            let hint = "n: samples every leaf from 4n x n directions; twice as many for the full sphere";
            let directions = row(ui, "Directions", hint, egui::Slider::new(directions, 1..=8));
            let hint = "Square root of the number of rays that are averaged per direction";
            let multisamples = row(ui, "Multisamples", hint, egui::Slider::new(multisamples, 1..=4));
            let mut enough = sample_fraction.is_none();
            let hint = "As many leaves as the palette needs: for tones, a part of those of large fields, otherwise all";
            ui.label("Enough leaves").on_hover_text(hint);
            let mut leaves = ui.checkbox(&mut enough, "").on_hover_text(hint).changed();
            ui.end_row();
            if leaves {
                *sample_fraction = if enough { None } else { Some(1.0) };
            }
            if let Some(fraction) = sample_fraction {
                let hint = "Fraction of the leaves to sample; lower is faster";
                leaves |= row(ui, "Leaves", hint, egui::Slider::new(fraction, 0.01..=1.0).max_decimals(2));
            }
            let hint = "Fraction of the visible weight above which a color starts a cluster; lower finds rarer colors";
            let threshold = egui::Slider::new(coarse_threshold, 1e-4..=0.1).logarithmic(true).max_decimals(4);
            let threshold = row(ui, "Threshold", hint, threshold);
            method | colors | observers | directions | multisamples | leaves | threshold
        })
        .inner
}

/// Shows two checkboxes, and the slider of the number of colors or of the tolerance.
fn choose_colors(ui: &mut egui::Ui, colors: &mut ColorCount) -> bool {
    let mut usual = *colors == ColorCount::Usual;
    let hint = "6 colors, or as many tones as the field needs";
    ui.label("Usual number").on_hover_text(hint);
    let mut switched = ui.checkbox(&mut usual, "").on_hover_text(hint).changed();
    ui.end_row();
    if switched {
        *colors = if usual { ColorCount::Usual } else { ColorCount::Fixed(6) };
    }
    if usual {
        return switched;
    }
    let mut auto = matches!(colors, ColorCount::Auto { .. });
    let hint = "Finds the fewest colors that keep the error within the tolerance";
    ui.label("Find the number").on_hover_text(hint);
    if ui.checkbox(&mut auto, "").on_hover_text(hint).changed() {
        *colors = if auto { ColorCount::AUTO } else { ColorCount::Fixed(6) };
        switched = true;
    }
    ui.end_row();
    let changed = match colors {
        ColorCount::Usual => false,
        ColorCount::Fixed(colors) => {
            row(ui, "Colors", "Number of palette colors to extract", egui::Slider::new(colors, 3..=40))
        }
        ColorCount::Auto { tolerance } => {
            let hint = "Largest difference between the field's colors and their labels";
            row(ui, "Tolerance", hint, egui::Slider::new(tolerance, 0.01..=0.2).max_decimals(3))
        }
    };
    switched | changed
}

/// Shows a list to choose from. Returns whether the choice changed.
fn choose<T: Copy + PartialEq>(
    ui: &mut egui::Ui,
    label: &str,
    hint: &str,
    value: &mut T,
    choices: &[T],
    name: impl Fn(T) -> &'static str,
) -> bool {
    let before = *value;
    ui.label(label).on_hover_text(hint);
    egui::ComboBox::from_id_salt(label).selected_text(name(before)).show_ui(ui, |ui| {
        for choice in choices {
            ui.selectable_value(value, *choice, name(*choice));
        }
    });
    ui.end_row();
    *value != before
}

fn observers_name(observers: ObserverRegion) -> &'static str {
    match observers {
        ObserverRegion::UpperHemisphere => "Upper hemisphere",
        ObserverRegion::Sphere => "Full sphere",
    }
}
