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
#[path = "../common/show.rs"]
mod show;

use std::process::ExitCode;

use bevy_plenoctree::PlenOctreePlugin;
use clap::Parser;

use show::Show;

/// Shows props whose palettes change: day and night (720 frames), two teams, a hit flash.
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
