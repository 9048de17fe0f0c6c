//! The panel next to the field.

use std::path::PathBuf;

use bevy::{camera::Viewport, prelude::*};
use bevy_egui::{EguiContexts, egui};
use bevy_plenoctree::{
    GpuField, PlenOctree, Prop,
    panel::{PaletteEditor, palette_ui},
};

use crate::{
    action::{Action, Colors, KEYS},
    loader::Loader,
    notices::name,
    palette_file,
};

#[derive(Resource)]
pub struct PanelState {
    pub open: bool,
    /// The field that the paths below belong to.
    of: Option<PathBuf>,
    /// The path of the field, as the user edits it.
    field: String,
    /// The paths for the source and the shown colors, as the user edits them.
    source: String,
    shown: String,
}

impl PanelState {
    pub fn new(open: bool) -> Self {
        Self { open, of: None, field: String::new(), source: String::new(), shown: String::new() }
    }

    /// Returns the file to which the shown colors are saved and from which they are loaded.
    pub fn shown_file(&self) -> PathBuf {
        PathBuf::from(self.shown.trim())
    }

    /// Resets the paths when another field is shown.
    fn follow(&mut self, loader: &Loader) {
        if let Some(path) = loader.shown()
            && self.of.as_deref() != Some(path)
        {
            self.of = Some(path.to_owned());
            self.field = path.display().to_string();
            self.source = palette_file::palette_beside(path).display().to_string();
            self.shown = palette_file::shown_beside(path).display().to_string();
        }
    }
}

pub fn show(
    mut contexts: EguiContexts,
    mut state: ResMut<PanelState>,
    mut actions: MessageWriter<Action>,
    mut background: ResMut<ClearColor>,
    mut editor: PaletteEditor,
    loader: Res<Loader>,
    fields: Res<Assets<PlenOctree>>,
    props: Query<(Entity, &Prop)>,
    camera: Option<Single<&mut Camera, With<Camera3d>>>,
) {
    let (Ok(context), Some(camera)) = (contexts.ctx_mut(), camera) else {
        return;
    };
    // When frames are slow, a press and a release are far apart but still count as a click.
    context.options_mut(|options| options.input_options.max_click_duration = f64::INFINITY);
    state.follow(&loader);
    let layout = egui::UiBuilder::new().layer_id(egui::LayerId::background()).max_rect(context.viewport_rect());
    let mut screen = egui::Ui::new(context.clone(), "viewer".into(), layout);
    if state.open {
        egui::Panel::right("panel").default_size(340.0).size_range(300.0..=520.0).show(&mut screen, |ui| {
            ui.spacing_mut().scroll = egui::style::ScrollStyle::solid();
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.add_space(4.0);
                let prop = props.iter().next();
                field_section(ui, &mut state, &loader, prop.and_then(|(_, prop)| fields.get(&prop.0)), &mut actions);
                ui.separator();
                if let Some((prop, _)) = prop {
                    palette_ui(ui, prop, &mut editor);
                    ui.separator();
                    file_section(ui, &mut state, &mut actions);
                    ui.separator();
                }
                view_section(ui, &mut background, &mut actions);
            });
        });
    }
    let free = screen.available_rect_before_wrap();
    give_room(camera.into_inner(), free, context.pixels_per_point());
}

/// Limits the viewport of the scene camera to the area next to the panel.
fn give_room(mut camera: Mut<Camera>, free: egui::Rect, pixels_per_point: f32) {
    let Some(whole) = camera.physical_target_size() else {
        return;
    };
    let pixels = |point: egui::Pos2| Vec2::new(point.x, point.y) * pixels_per_point;
    let low = pixels(free.min).round().as_uvec2().min(whole.saturating_sub(UVec2::ONE));
    let high = pixels(free.max).round().as_uvec2().clamp(low + 1, whole.max(low + 1));
    let viewport = (low, high - low);
    if camera.viewport.as_ref().map(|old| (old.physical_position, old.physical_size)) != Some(viewport) {
        camera.viewport = Some(Viewport { physical_position: low, physical_size: high - low, ..default() });
    }
}

fn field_section(
    ui: &mut egui::Ui,
    state: &mut PanelState,
    loader: &Loader,
    field: Option<&PlenOctree>,
    actions: &mut MessageWriter<Action>,
) {
    match (loader.shown(), field) {
        (Some(path), Some(field)) => {
            ui.heading(name(path));
            let megabytes = GpuField::byte_size(field) as f64 * 1e-6;
            let (leaves, depth, basis) = (field.leaves(), field.depth(), field.basis().name());
            ui.weak(format!("{leaves} leaves, depth {depth}, {basis}, {megabytes:.0} MB on the GPU"));
        }
        _ => {
            ui.heading("No field");
            ui.weak("Drop a field here, or enter its path.");
        }
    }
    ui.horizontal(|ui| {
        let open = ui.button("Open").clicked();
        let entered = path_edit(ui, &mut state.field);
        if (open || entered) && !state.field.trim().is_empty() {
            actions.write(Action::Open(PathBuf::from(state.field.trim())));
        }
    });
}

fn file_section(ui: &mut egui::Ui, state: &mut PanelState, actions: &mut MessageWriter<Action>) {
    ui.strong("Files");
    let rows = [
        (
            "Source",
            Colors::Source,
            &mut state.source,
            "The palette, with its shown colors. Games load it from this file, next to the field",
        ),
        ("Shown", Colors::Shown, &mut state.shown, "The colors that this prop shows instead of the source colors"),
    ];
    for (label, colors, path, hint) in rows {
        ui.horizontal(|ui| {
            ui.label(label).on_hover_text(hint);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let file = PathBuf::from(path.trim());
                if ui.button("Load").clicked() {
                    actions.write(Action::Load(file.clone(), colors));
                }
                if ui.button("Save").clicked() {
                    actions.write(Action::Save(file, colors));
                }
                path_edit(ui, path);
            });
        });
    }
}

fn view_section(ui: &mut egui::Ui, background: &mut ClearColor, actions: &mut MessageWriter<Action>) {
    ui.horizontal(|ui| {
        if ui.button("Frame the field").clicked() {
            actions.write(Action::FrameView);
        }
        if ui.button("Screenshot").clicked() {
            actions.write(Action::Screenshot);
        }
        let mut color = Srgba::from(background.0).to_u8_array_no_alpha();
        if ui.color_edit_button_srgb(&mut color).on_hover_text("The background color").changed() {
            let [r, g, b] = color;
            background.0 = Color::srgb_u8(r, g, b);
        }
    });
    egui::CollapsingHeader::new("Keys and mouse").show(ui, |ui| {
        egui::Grid::new("keys").num_columns(2).show(ui, |ui| {
            let mouse = [("Left drag", "orbit"), ("Right drag", "pan"), ("Wheel", "zoom")];
            for (key, what) in mouse.into_iter().chain(KEYS) {
                ui.strong(key);
                ui.label(what);
                ui.end_row();
            }
        });
    });
}

/// Returns whether the user pressed Enter.
fn path_edit(ui: &mut egui::Ui, path: &mut String) -> bool {
    let edit = ui.add(egui::TextEdit::singleline(path).desired_width(f32::INFINITY));
    edit.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter))
}
