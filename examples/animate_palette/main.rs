//! Palettes that a game plays with: day and night, two teams, and a drum that flashes when it is hit (space, a click).
//!
//! The props' palettes lie beside them in `assets/`, so that nothing is extracted.
//!
//! ```sh
//! cargo run --release --example animate_palette
//! cargo run --release --example animate_palette -- --headless night.png --at-frame 360
//! ```

mod game;
mod scene;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use bevy::{light::LightPlugin, pbr::PbrPlugin, prelude::*, time::TimeUpdateStrategy, window::WindowResolution};
use bevy_plenoctree::{PlenOctreePlugin, headless::Headless};
use clap::Parser;

/// Shows props whose palettes change: day and night, two teams, a hit flash.
#[derive(Parser)]
struct Arguments {
    /// Opens no window: writes one picture to this file.
    #[arg(long, value_name = "FILE.png")]
    headless: Option<PathBuf>,
    /// Size of the window, or of the picture, in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = parse_size)]
    size: (u32, u32),
    /// Which frame the picture shows: 60 are a second, 720 a day.
    #[arg(long, value_name = "N", requires = "headless", default_value_t = 0)]
    at_frame: u32,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match &arguments.headless {
        Some(file) => picture(&arguments, file),
        None => return window(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn window(arguments: &Arguments) -> ExitCode {
    let window =
        Window { title: "Animated palettes".into(), resolution: WindowResolution::from(arguments.size), ..default() };
    let exit = App::new()
        .add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_plugins((PlenOctreePlugin, scene::plugin, game::plugin))
        .run();
    if exit.is_success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn picture(arguments: &Arguments, file: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let mut headless = Headless::new(arguments.size.into(), |app| {
        app.add_plugins((LightPlugin, PbrPlugin::default(), PlenOctreePlugin, scene::plugin, game::plugin));
    })?;
    // Time stands still until everything is there, and again for the picture.
    set_frame_time(&mut headless, Duration::ZERO);
    headless.wait_until_ready(Duration::from_secs(600))?;
    set_frame_time(&mut headless, Duration::from_secs(1) / 60);
    for _ in 0..arguments.at_frame {
        headless.update();
    }
    set_frame_time(&mut headless, Duration::ZERO);

    // The camera comes last: nobody looks at the frames before.
    let target = headless.target();
    headless.app.world_mut().spawn((scene::camera(), target));
    headless.picture()?.save(file).map_err(|error| format!("{}: {error}", file.display()))?;
    Ok(())
}

fn set_frame_time(headless: &mut Headless, time: Duration) {
    headless.app.insert_resource(TimeUpdateStrategy::ManualDuration(time));
}

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse().ok().filter(|pixels| (64..=8192).contains(pixels));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or_else(|| "expected WxH, each from 64 to 8192".into())
}
