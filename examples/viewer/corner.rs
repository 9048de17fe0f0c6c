//! Messages and progress in the lower left corner.

use std::time::Instant;

use bevy::{prelude::*, render::view::screenshot::Screenshot};
use bevy_egui::{EguiContexts, egui};
use bevy_plenoctree::{PaletteExtraction, Prop};

use crate::{
    loader::Loader,
    notices::{Notices, name},
};

pub fn show(
    mut contexts: EguiContexts,
    mut notices: ResMut<Notices>,
    loader: Res<Loader>,
    extraction: Res<PaletteExtraction>,
    props: Query<&Prop>,
    screenshots: Query<(), With<Screenshot>>,
    camera: Option<Single<&Camera, With<Camera3d>>>,
) {
    let Ok(context) = contexts.ctx_mut() else {
        return;
    };
    if !screenshots.is_empty() {
        return;
    }
    let now = Instant::now();
    notices.list.retain(|notice| notice.until.is_none_or(|until| until > now));
    let extracting = props.iter().find_map(|prop| extraction.progress(&prop.0));
    let room = camera.and_then(|camera| camera.logical_viewport_size()).map_or(f32::MAX, |size| size.x - 48.0);
    let area = egui::Area::new("notices".into()).anchor(egui::Align2::LEFT_BOTTOM, [12.0, -12.0]);
    area.show(context, |ui| {
        ui.set_max_width(room.clamp(160.0, 560.0));
        if notices.dropping {
            framed(ui, |ui| ui.strong("Drop a field (.npz, .plenoctree) or a palette (.json)"));
        }
        if let Some((path, share)) = loader.reading() {
            show_progress(ui, &format!("Reading {}", name(path)), share);
        }
        if let Some(share) = extracting {
            show_progress(ui, "Extracting the palette", share);
        }
        let mut closed = None;
        for (index, notice) in notices.list.iter().enumerate() {
            framed(ui, |ui| {
                let is_error = notice.until.is_none();
                let color = if is_error { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
                ui.add(egui::Label::new(egui::RichText::new(&notice.text).color(color)).wrap());
                if is_error && ui.button("Close").clicked() {
                    closed = Some(index);
                }
            });
        }
        if let Some(index) = closed {
            notices.list.remove(index);
        }
    });
}

fn show_progress(ui: &mut egui::Ui, what: &str, share: f32) {
    framed(ui, |ui| {
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label(format!("{what}: {:.0}%", 100.0 * share));
        });
    });
}

fn framed<R>(ui: &mut egui::Ui, contents: impl FnOnce(&mut egui::Ui) -> R) {
    egui::Frame::popup(ui.style()).show(ui, contents);
}
