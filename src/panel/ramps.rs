//! The rows of the panel that show and edit ramps.

use bevy::prelude::*;
use bevy_egui::egui;

use super::{
    colors::{Colors, bytes, edit_swatch},
    editor::{ColorEdit, Edit},
};

/// The size of a ramp's color.
const RAMP: egui::Vec2 = egui::vec2(40.0, 20.0);
/// The size of a tone, if there is room for all.
const TONE: egui::Vec2 = egui::vec2(16.0, 20.0);
/// The width of what follows the tones: the share of the ramp, and a button.
const REST: f32 = 96.0;

/// A tone that is dragged to another ramp.
struct Dragged(usize);

/// Shows a row for each ramp and returns the user's edit, if any. A row has the ramp's name and color, and its tones,
/// which can be dragged to another row.
pub(super) fn rows(ui: &mut egui::Ui, colors: &Colors) -> Option<Edit> {
    let mut edit = None;
    for ramp in 0..colors.palette.ramps().len() {
        let (row, dropped) = ui.dnd_drop_zone::<Dragged, _>(egui::Frame::new().inner_margin(2.0), |ui| {
            ui.horizontal(|ui| row(ui, colors, ramp)).inner
        });
        edit = dropped.map(|tone| Edit::Move(tone.0, ramp)).or(row.inner).or(edit);
    }
    edit
}

fn row(ui: &mut egui::Ui, colors: &Colors, ramp: usize) -> Option<Edit> {
    let (name, tones) = (&colors.palette.ramps()[ramp].name, &colors.palette.ramps()[ramp].tones);
    let mut edit = None;
    if colors.own.is_some() {
        // Overrides refer to ramps by name.
        ui.add_sized([80.0, RAMP.y], egui::Label::new(name).truncate());
    } else if let Some(name) = edit_name(ui, name, ramp) {
        edit = Some(Edit::Rename(ramp, name));
    }
    if let Some(color) = edit_swatch(ui, colors.ramp_color(ramp), RAMP).inner {
        edit = Some(ColorEdit::SetRamp(ramp, color).into());
    }
    ui.spacing_mut().item_spacing.x = 1.0;
    let room = (ui.available_width() - REST) / tones.len().max(1) as f32 - 1.0;
    let size = egui::vec2(TONE.x.min(room).max(2.0), TONE.y);
    for &tone in tones {
        let egui::InnerResponse { inner, response } = edit_swatch(ui, colors.shown[tone], size);
        edit = inner.map(|color| ColorEdit::Set(tone, color).into()).or(edit);
        // One widget for both, because egui ignores clicks on what can only be dragged.
        let response = response.interact(egui::Sense::drag());
        response.dnd_set_drag_payload(Dragged(tone));
        if let (true, Some(at)) = (response.dragged(), ui.ctx().pointer_interact_pos()) {
            let [r, g, b] = bytes(colors.shown[tone]);
            let painter = ui.ctx().layer_painter(egui::LayerId::new(egui::Order::Tooltip, response.id));
            painter.rect_filled(egui::Rect::from_center_size(at, size), 2.0, egui::Color32::from_rgb(r, g, b));
        }
    }
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        if ui.add_enabled(colors.is_ramp_edited(ramp), egui::Button::new("Reset").small()).clicked() {
            edit = Some(ColorEdit::ResetRamp(ramp).into());
        }
        let share: f64 = tones.iter().map(|tone| colors.share(*tone)).sum();
        ui.label(format!("{share:.1}%"));
    });
    edit
}

/// Shows a name that can be edited and returns the new one when the user has finished.
fn edit_name(ui: &mut egui::Ui, name: &str, ramp: usize) -> Option<String> {
    let id = ui.id().with(("name", ramp));
    let mut text = ui.data(|data| data.get_temp(id)).unwrap_or_else(|| name.to_string());
    let response = ui.add(egui::TextEdit::singleline(&mut text).desired_width(80.0));
    if response.lost_focus() {
        ui.data_mut(|data| data.remove::<String>(id));
        // Names have no spaces at their ends.
        let text = text.trim();
        let is_canceled = ui.input(|input| input.key_pressed(egui::Key::Escape));
        return (text != name && !is_canceled).then(|| text.to_string());
    }
    if response.changed() {
        ui.data_mut(|data| data.insert_temp(id, text));
    } else if !response.has_focus() {
        // Another prop was shown while the user typed.
        ui.data_mut(|data| data.remove::<String>(id));
    }
    None
}
