//! Shows a room with four toys. Press space to pull the lever: night falls, the lamps come on, the toadstool glows, and
//! the robot marches. Drag with the mouse to orbit the camera.
//!
//! Combines lit meshes with shadows, glass in front of and behind props, HDR with bloom and tonemapping, and props in
//! four styles: a cartoon that glows in the dark, a comic with lines, soft tones, and a field as trained. The props
//! cast shadows, and shadows fall on them.
//!
//! ```sh
//! cargo run --release --example scene
//! cargo run --release --example scene -- --headless night.png --at-frame 400
//! ```

#[path = "../common/build.rs"]
mod build;
mod game;
mod lamps;
#[path = "../common/night.rs"]
mod night;
mod room;
#[path = "../common/show.rs"]
mod show;
#[path = "../common/stand.rs"]
mod stand;
mod toys;

use std::process::ExitCode;

use bevy::{core_pipeline::tonemapping::Tonemapping, post_process::bloom::Bloom, prelude::*};
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_plenoctree::PlenOctreePlugin;
use clap::Parser;

use show::Show;

/// Shows a room with four toys. Press space to switch between day and night.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    show: Show,
}

fn main() -> ExitCode {
    show::exit_code(Arguments::parse().show.run("The toy room", build, show::wait_for_props))
}

fn build(app: &mut App) {
    app.add_plugins((PlenOctreePlugin, PanOrbitCameraPlugin))
        .add_plugins((game::plugin, lamps::plugin, room::plugin, stand::plugin, toys::plugin))
        .add_systems(Startup, spawn_camera);
}

fn spawn_camera(mut commands: Commands) {
    let focus = Vec3::new(0.0, 1.4, 0.0);
    commands.spawn((
        // This leaves all but very bright colors unchanged, so palette colors stay as they are.
        Tonemapping::KhronosPbrNeutral,
        Bloom { intensity: 0.12, ..Bloom::NATURAL },
        Projection::from(PerspectiveProjection { fov: 0.5, ..default() }),
        Transform::from_xyz(0.0, 3.0, 10.5).looking_at(focus, Vec3::Y),
        // Keep the camera inside the room and above the floor.
        PanOrbitCamera {
            focus,
            yaw_lower_limit: Some(-0.5),
            yaw_upper_limit: Some(0.5),
            pitch_lower_limit: Some(0.02),
            pitch_upper_limit: Some(0.4),
            zoom_lower_limit: 4.0,
            zoom_upper_limit: Some(11.0),
            ..default()
        },
    ));
}
