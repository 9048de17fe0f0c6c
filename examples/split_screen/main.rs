//! Runs a game for two players in split screen. Each robot collects gumballs and carries them on its head; the first
//! one with seven wins the round. WASD moves the red robot, the arrow keys move the blue one. A robot plays by itself
//! until its player presses a key.
//!
//! Both robots share one field, and a `PaletteOverride` gives each its team's color. The gumball machine in the middle
//! also has an override, which shows the color of the leader.
//!
//! ```sh
//! cargo run --release --example split_screen
//! cargo run --release --example split_screen -- --headless round.png --at-frame 600
//! ```

mod arena;
mod autopilot;
mod balls;
#[path = "../common/build.rs"]
mod build;
mod robots;
#[path = "../common/show.rs"]
mod show;
#[path = "../common/stand.rs"]
mod stand;
mod views;

use std::process::ExitCode;

use bevy::prelude::*;
use bevy_plenoctree::PlenOctreePlugin;
use clap::Parser;

use show::Show;

/// Runs a game for two players who collect gumballs, each with their own robot and view.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    show: Show,
}

fn main() -> ExitCode {
    show::exit_code(Arguments::parse().show.run("Split screen", build, show::wait_for_props))
}

fn build(app: &mut App) {
    app.add_plugins((PlenOctreePlugin, stand::plugin)).add_plugins((
        arena::plugin,
        robots::plugin,
        autopilot::plugin,
        balls::plugin,
        views::plugin,
    ));
}
