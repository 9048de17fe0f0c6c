//! What every windowed example shares: a window, or one picture without a window.

mod size;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use bevy::{
    gizmos::GizmoPlugin, gizmos_render::GizmoRenderPlugin, light::LightPlugin, pbr::PbrPlugin,
    post_process::PostProcessPlugin, prelude::*, time::TimeUpdateStrategy, window::WindowResolution,
};
use bevy_plenoctree::headless::Headless;

/// The arguments, to be flattened into an example's own.
#[derive(clap::Args)]
pub struct Show {
    /// Opens no window: writes one picture to this file as soon as fields and palettes are there.
    #[arg(long, value_name = "FILE.png")]
    pub headless: Option<PathBuf>,
    /// Size of the window, or of the picture, in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size::parse_size)]
    size: (u32, u32),
    /// Which frame the picture shows: 60 are a second.
    #[arg(long, value_name = "N", requires = "headless", default_value_t = 0)]
    at_frame: u32,
}

pub type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;

/// How long fields and palettes may take.
const PATIENCE: Duration = Duration::from_secs(3600);

/// What `main` returns: 2, with a message, for what went wrong.
pub fn exit_code(result: Result) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Steps an app until the fields and palettes of its props are there.
pub fn wait_for_props(headless: &mut Headless) -> Result {
    Ok(headless.wait_until_ready(PATIENCE)?)
}

impl Show {
    /// Runs the app that `build` makes in a window; or, without a window, steps it with `wait` until everything is there,
    /// while time stands still, and then to the frame whose picture is taken.
    pub fn run(&self, title: &str, build: impl FnOnce(&mut App), wait: impl FnOnce(&mut Headless) -> Result) -> Result {
        match &self.headless {
            Some(file) => self.picture(file, build, wait),
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
            AppExit::Error(code) => Err(format!("the app ended with code {code}").into()),
        }
    }

    fn picture(&self, file: &Path, build: impl FnOnce(&mut App), wait: impl FnOnce(&mut Headless) -> Result) -> Result {
        let mut headless = Headless::new(self.size.into(), |app| {
            app.add_plugins((GizmoPlugin, GizmoRenderPlugin, LightPlugin, PbrPlugin::default(), PostProcessPlugin));
            build(app);
        })?;
        let target = headless.target();
        headless.app.add_observer(move |camera: On<Add, Camera>, mut commands: Commands| {
            commands.entity(camera.entity).insert(target.clone());
        });

        set_frame_time(&mut headless, Duration::ZERO);
        wait(&mut headless)?;
        set_frame_time(&mut headless, Duration::from_secs(1) / 60);
        play_unseen(&mut headless, self.at_frame);
        set_frame_time(&mut headless, Duration::ZERO);
        headless.capture()?.save(file).map_err(|error| format!("{}: {error}", file.display()))?;
        Ok(())
    }
}

fn set_frame_time(headless: &mut Headless, time: Duration) {
    headless.app.insert_resource(TimeUpdateStrategy::ManualDuration(time));
}

/// Runs frames that nobody looks at, and that need not be drawn.
fn play_unseen(headless: &mut Headless, frames: u32) {
    let world = headless.app.world_mut();
    let mut cameras = world.query::<(Entity, &mut Camera)>();
    let mut paused = Vec::new();
    for (entity, mut camera) in cameras.iter_mut(world) {
        if std::mem::replace(&mut camera.is_active, false) {
            paused.push(entity);
        }
    }
    for _ in 0..frames {
        headless.update();
    }
    let world = headless.app.world_mut();
    for entity in paused {
        if let Some(mut camera) = world.get_mut::<Camera>(entity) {
            camera.is_active = true;
        }
    }
}
