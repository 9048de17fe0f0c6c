//! Saves props with their colors and settings to a file, and loads them again.
//!
//! Press space to change the props, S to save them, and L to load them. If the file exists, they are loaded at the
//! start.
//!
//! ```sh
//! cargo run --release --example saved_world
//! cargo run --release --example saved_world -- --world shelf.scn.ron --headless shelf.png
//! ```

#[path = "../common/show.rs"]
mod show;
mod toys;
mod world_file;

use std::{path::PathBuf, process::ExitCode};

use bevy::prelude::*;
use bevy_plenoctree::PlenOctreePlugin;
use clap::Parser;

use show::Show;
use world_file::WorldFile;

/// Shows props that are saved to a file and loaded again.
#[derive(Parser)]
struct Arguments {
    /// The file to save to and to load from.
    #[arg(long, value_name = "FILE.scn.ron", default_value = "saved_world.scn.ron")]
    world: PathBuf,
    #[command(flatten)]
    show: Show,
}

fn main() -> ExitCode {
    let Arguments { world, show } = Arguments::parse();
    show::exit_code(show.run(
        "A saved world",
        |app| {
            app.add_plugins((PlenOctreePlugin, toys::plugin, world_file::plugin)).insert_resource(WorldFile(world));
            if show.headless.is_none() {
                app.add_systems(Startup, world_file::start.pipe(world_file::log));
            }
        },
        |headless| {
            world_file::start(headless.app.world_mut())?;
            show::wait_for_props(headless)
        },
    ))
}
