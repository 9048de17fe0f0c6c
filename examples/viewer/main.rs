//! Shows a field in a window, and extracts and edits its palette.
//!
//! ```sh
//! cargo run --release --example viewer -- field.npz
//! cargo run --release --example viewer -- field.npz --headless frame.png --panel
//! ```

mod action;
mod arguments;
mod corner;
mod extent;
mod headless;
mod input;
mod loader;
mod notices;
mod pace;
mod palette_file;
mod panel;
mod scene;
mod screenshot;
#[path = "../common/show.rs"]
mod show;

use std::{fs::File, path::Path, process::ExitCode};

use bevy::prelude::*;
use bevy_egui::{EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass};
use bevy_panorbit_camera::PanOrbitCameraPlugin;
use bevy_plenoctree::{Palette, PlenOctreePlugin};
use clap::Parser;

use action::Action;
use arguments::Arguments;
use show::Result;

fn main() -> ExitCode {
    show::exit_code(run(Arguments::parse()))
}

fn run(arguments: Arguments) -> Result {
    check_readable(&arguments.field())?;
    let palette = arguments.palette.as_ref().map(Palette::read).transpose()?;
    arguments.show.run("PlenOctree viewer", |app| build(app, &arguments, palette), headless::wait)
}

/// Reports a wrong path immediately. Errors inside the file are shown in the window.
fn check_readable(path: &Path) -> Result<()> {
    let readable = File::open(path).and_then(|file| match file.metadata()?.is_dir() {
        true => Err(std::io::ErrorKind::IsADirectory.into()),
        false => Ok(()),
    });
    readable.map_err(|error| format!("{}: cannot be read: {error}", path.display()).into())
}

fn build(app: &mut App, arguments: &Arguments, palette: Option<Palette>) {
    let has_window = arguments.show.headless.is_none();
    app.add_plugins((PlenOctreePlugin, EguiPlugin::default(), PanOrbitCameraPlugin))
        .insert_resource(loader::Loader::new(
            arguments.load_settings(),
            palette.map(|palette| (arguments.field(), palette)),
        ))
        .insert_resource(panel::PanelState::new(has_window || arguments.panel))
        .init_resource::<notices::Notices>()
        .add_message::<Action>()
        .insert_resource(scene::CameraQuality(arguments.quality))
        .add_systems(Startup, scene::spawn_cameras)
        .add_systems(
            Update,
            (loader::open, loader::watch, loader::arrive, palette_file::transfer, scene::frame_view).chain(),
        )
        .add_systems(EguiPrimaryContextPass, (panel::show, corner::show).chain());
    if has_window {
        app.add_systems(Update, (input::press_keys, input::drop_files, input::orbit, screenshot::take, pace::set));
    }
    // The UI has its own camera, so that the scene camera can leave room for the panel.
    app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
    app.world_mut().write_message(Action::Open(arguments.field()));
}
