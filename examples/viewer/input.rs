//! Handles keys and dropped files, and enables the camera's mouse controls.

use bevy::{prelude::*, window::FileDragAndDrop};
use bevy_egui::input::EguiWantsInput;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_plenoctree::{Prop, panel::PaletteEditor};

use crate::{
    action::{Action, Colors},
    notices::Notices,
    panel::PanelState,
};

pub fn press_keys(
    keys: Res<ButtonInput<KeyCode>>,
    egui: Res<EguiWantsInput>,
    mut panel: ResMut<PanelState>,
    mut actions: MessageWriter<Action>,
    mut editor: PaletteEditor,
    props: Query<Entity, With<Prop>>,
) {
    if keys.just_pressed(KeyCode::F12) {
        actions.write(Action::Screenshot);
    }
    if egui.wants_any_keyboard_input() {
        return;
    }
    // In a slow frame, the control key can be released already.
    let control = [KeyCode::ControlLeft, KeyCode::ControlRight];
    if keys.any_pressed(control) || keys.any_just_pressed(control) {
        if keys.just_pressed(KeyCode::KeyS) {
            actions.write(Action::Save(panel.shown_file(), Colors::Shown));
        }
        if keys.just_pressed(KeyCode::KeyO) {
            actions.write(Action::Load(panel.shown_file(), Colors::Shown));
        }
        return;
    }
    if keys.just_pressed(KeyCode::KeyF) {
        actions.write(Action::FrameView);
    }
    if keys.just_pressed(KeyCode::KeyH) {
        panel.open = !panel.open;
    }
    if keys.just_pressed(KeyCode::KeyP) {
        for prop in &props {
            let posterized = editor.is_posterized(prop);
            editor.set_posterized(prop, !posterized);
        }
    }
}

pub fn drop_files(
    mut drops: MessageReader<FileDragAndDrop>,
    mut actions: MessageWriter<Action>,
    mut notices: ResMut<Notices>,
) {
    for event in drops.read() {
        notices.dropping = matches!(event, FileDragAndDrop::HoveredFile { .. });
        if let FileDragAndDrop::DroppedFile { path_buf, .. } = event {
            let is_palette = path_buf.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
            actions.write(match is_palette {
                true => Action::Load(path_buf.clone(), Colors::Either),
                false => Action::Open(path_buf.clone()),
            });
        }
    }
}

/// Stops the camera while the UI uses the pointer or the keyboard.
pub fn orbit(egui: Res<EguiWantsInput>, mut cameras: Query<&mut PanOrbitCamera>) {
    let enabled = !(egui.wants_pointer_input() || egui.is_popup_open() || egui.wants_keyboard_input());
    for mut camera in &mut cameras {
        if camera.enabled != enabled {
            camera.enabled = enabled;
        }
    }
}
