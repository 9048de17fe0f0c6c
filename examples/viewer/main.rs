//! A window to look at a field, and to make and change its palette.
//!
//! ```sh
//! cargo run --release --example viewer -- field.npz
//! cargo run --release --example viewer -- field.npz --headless picture.png --panel
//! ```

mod action;
mod arguments;
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

use std::{fs::File, path::Path, process::ExitCode};

use bevy::{prelude::*, window::WindowResolution};
use bevy_egui::{EguiGlobalSettings, EguiPlugin, EguiPrimaryContextPass};
use bevy_panorbit_camera::PanOrbitCameraPlugin;
use bevy_plenoctree::{Palette, PlenOctreePlugin};
use clap::Parser;

use action::Action;
use arguments::Arguments;

type Result<T, E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<ExitCode> {
    check_readable(&arguments.field())?;
    let palette = arguments.palette.as_ref().map(Palette::read).transpose()?;
    let viewer = Viewer { arguments, palette };
    match &arguments.headless {
        Some(file) => headless::picture(viewer, arguments, file).map(|()| ExitCode::SUCCESS),
        None => Ok(match window(viewer, arguments) {
            AppExit::Success => ExitCode::SUCCESS,
            AppExit::Error(_) => ExitCode::FAILURE,
        }),
    }
}

/// What is wrong inside the file is shown in the window, but a path with a slip in it is better found out at once.
fn check_readable(path: &Path) -> Result<()> {
    let readable = File::open(path).and_then(|file| match file.metadata()?.is_dir() {
        true => Err(std::io::ErrorKind::IsADirectory.into()),
        false => Ok(()),
    });
    readable.map_err(|error| format!("{}: cannot be read: {error}", path.display()).into())
}

fn window(viewer: Viewer, arguments: &Arguments) -> AppExit {
    let window =
        Window { title: "PlenOctree viewer".into(), resolution: WindowResolution::from(arguments.size), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }));
    viewer.build(&mut app);
    scene::spawn_cameras(app.world_mut(), default());
    app.add_systems(Update, (input::press_keys, input::drop_files, input::orbit, screenshot::take, pace::set));
    app.run()
}

/// All but the window.
struct Viewer<'a> {
    arguments: &'a Arguments,
    palette: Option<Palette>,
}

impl Viewer<'_> {
    fn build(self, app: &mut App) {
        app.add_plugins((PlenOctreePlugin, EguiPlugin::default(), PanOrbitCameraPlugin))
            .insert_resource(loader::Loader::new(self.arguments.load_settings(), self.palette))
            .insert_resource(panel::PanelState::new(self.arguments.headless.is_none() || self.arguments.panel))
            .init_resource::<notices::Notices>()
            .add_message::<Action>()
            .add_systems(
                Update,
                (loader::open, loader::watch, loader::arrive, palette_file::transfer, scene::frame_view).chain(),
            )
            .add_systems(EguiPrimaryContextPass, (panel::show, notices::show).chain());
        // The interface has a camera of its own, so that the scene's can leave room for the panel.
        app.world_mut().resource_mut::<EguiGlobalSettings>().auto_create_primary_context = false;
        app.world_mut().write_message(Action::Open(self.arguments.field()));
    }
}
