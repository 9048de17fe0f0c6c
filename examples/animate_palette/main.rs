//! Animates palettes: day and night, team colors, and a drum that flashes when it is hit (press space, or click).
//!
//! The palette of the toadstool is extracted when the app starts. Those of the others are loaded from files next to
//! their fields in `assets/`.
//!
//! ```sh
//! cargo run --release --example animate_palette
//! cargo run --release --example animate_palette -- --headless night.png --at-frame 360
//! ```

mod game;
#[path = "../common/night.rs"]
mod night;
mod scene;
#[path = "../common/show.rs"]
mod show;

use std::process::ExitCode;

use bevy_plenoctree::PlenOctreePlugin;
use clap::Parser;

use show::Show;

/// Shows animated palettes: day and night (720 frames), team colors, and a hit flash.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    show: Show,
}

fn main() -> ExitCode {
    let show = Arguments::parse().show;
    show::exit_code(show.run(
        "Animated palettes",
        |app| {
            app.add_plugins((PlenOctreePlugin, scene::plugin, game::plugin));
        },
        show::wait_for_props,
    ))
}
