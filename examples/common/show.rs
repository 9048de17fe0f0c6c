//! Shows an example in a window, or captures one of its frames without a window.

mod size;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use bevy::{prelude::*, time::TimeUpdateStrategy, window::WindowResolution};
use bevy_plenoctree::headless::{Headless, LitMeshPlugins};

/// Arguments that the windowed examples share.
#[derive(clap::Args)]
pub struct Show {
    /// Captures one frame to this file, without a window, once fields and palettes are ready.
    #[arg(long, value_name = "FILE.png")]
    pub headless: Option<PathBuf>,
    /// Size of the window or the captured frame, in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size::parse_size)]
    size: (u32, u32),
    /// The frame to capture, at 60 frames per second.
    #[arg(long, value_name = "N", requires = "headless", default_value_t = 0)]
    at_frame: u32,
}

pub type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// How long to wait for fields and palettes.
const TIMEOUT: Duration = Duration::from_secs(3600);

/// Returns the exit code for `main`. Prints errors and returns 2 for them.
pub fn exit_code(result: Result) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Updates an app until the fields and palettes of its props are ready.
pub fn wait_for_props(headless: &mut Headless) -> Result {
    Ok(headless.wait_until_ready(TIMEOUT)?)
}

impl Show {
    /// Runs the app that `build` sets up in a window. With `--headless`, calls `wait` to update the app until
    /// everything is ready, while time stands still, and then captures the requested frame.
    pub fn run(&self, title: &str, build: impl FnOnce(&mut App), wait: impl FnOnce(&mut Headless) -> Result) -> Result {
        match &self.headless {
            Some(file) => self.capture(file, build, wait),
            None => self.window(title, build),
        }
    }

    fn window(&self, title: &str, build: impl FnOnce(&mut App)) -> Result {
        let window = Window { title: title.into(), resolution: WindowResolution::from(self.size), ..default() };
        let mut app = App::new();
        app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }));
        build(&mut app);
        match app.run() {
            AppExit::Success => Ok(()),
            AppExit::Error(code) => Err(format!("the app exited with code {code}").into()),
        }
    }

    fn capture(&self, file: &Path, build: impl FnOnce(&mut App), wait: impl FnOnce(&mut Headless) -> Result) -> Result {
        let mut headless = Headless::new(self.size.into(), |app| {
            app.add_plugins(LitMeshPlugins);
            build(app);
        })?;
        let target = headless.target();
        headless.app.add_observer(move |camera: On<Add, Camera>, mut commands: Commands| {
            commands.entity(camera.entity).insert(target.clone());
        });

        set_frame_time(&mut headless, Duration::ZERO);
        wait(&mut headless)?;
        set_frame_time(&mut headless, Duration::from_secs(1) / 60);
        (0..self.at_frame).for_each(|_| headless.update_without_drawing());
        set_frame_time(&mut headless, Duration::ZERO);
        headless.capture()?.save(file).map_err(|error| format!("{}: {error}", file.display()))?;
        Ok(())
    }
}

fn set_frame_time(headless: &mut Headless, time: Duration) {
    headless.app.insert_resource(TimeUpdateStrategy::ManualDuration(time));
}
