//! Runs a toy maker's paint shop: dip the brush into a tin, click a region of a toy to paint it, and make each toy look
//! like its picture on the wall. Clicking a region that already has the brush's paint washes it off.
//!
//! ```sh
//! cargo run --release --example picking
//! cargo run --release --example picking -- --headless picking.png --at-frame 420
//! ```

mod brush;
#[path = "../common/build.rs"]
mod build;
mod game;
mod hand;
#[path = "../common/show.rs"]
mod show;
mod stage;
#[path = "../common/stand.rs"]
mod stand;
mod tin;

use std::process::ExitCode;

use bevy::{picking::DefaultPickingPlugins, prelude::*};
use bevy_plenoctree::{PlenOctreePlugin, PropPickingPlugin};
use clap::Parser;

use show::Show;

/// Runs a paint shop for toys: click a region to paint it. Without a window, the game plays by itself.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    show: Show,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    show::exit_code(arguments.show.run("Paint shop", build, show::wait_for_props))
}

fn build(app: &mut App) {
    // With a window, Bevy's default plugins already include picking.
    if !app.is_plugin_added::<bevy::picking::PickingPlugin>() {
        app.add_plugins((DefaultPickingPlugins, hand::plugin));
    }
    app.add_plugins((PlenOctreePlugin, PropPickingPlugin, stand::plugin, stage::plugin, game::plugin, brush::plugin));
}
