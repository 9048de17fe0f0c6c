//! Two players, two robots, one arena: gumballs are carried on the head, and the first who has seven wins a round. The red
//! robot goes by WASD, the blue one by the arrows; until its player touches a key, a robot plays by itself.
//!
//! Both robots are one field, in the colors of their teams (`PaletteOverride`); so is the gumball machine in the middle,
//! which wears the color of who leads.
//!
//! ```sh
//! cargo run --release --example split_screen
//! cargo run --release --example split_screen -- --headless round.png --at-frame 600
//! ```

mod arena;
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

/// Two players collect gumballs, each with a robot and a view of its own.
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
        balls::plugin,
        views::plugin,
    ));
}
