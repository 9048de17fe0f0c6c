//! Shows a carousel of many toys: five fields, and many copies of them, each with its own position, size and colors.
//!
//! In a window, prints once a second how long a frame takes. Without one, prints how long a frame with all toys took,
//! to compare with `--count 1`.
//!
//! ```sh
//! cargo run --release --example many_props -- --count 256
//! cargo run --release --example many_props -- --count 256 --headless carousel.png
//! ```

#[path = "../common/build.rs"]
mod build;
mod carousel;
mod measure;
#[path = "../common/show.rs"]
mod show;
#[path = "../common/stand.rs"]
mod stand;
mod toys;

use std::process::ExitCode;

use bevy::prelude::*;
use bevy_plenoctree::PlenOctreePlugin;
use clap::Parser;

use show::Show;

/// Shows a carousel of many toys, and prints how long a frame takes.
#[derive(Parser)]
struct Arguments {
    /// The number of toys.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    count: u32,
    #[command(flatten)]
    show: Show,
}

fn main() -> ExitCode {
    let Arguments { count, show } = Arguments::parse();
    let build = |app: &mut App| {
        app.add_plugins((PlenOctreePlugin, stand::plugin, toys::plugin, carousel::plugin(count)));
        if show.headless.is_none() {
            app.add_systems(Update, measure::print_frame_time);
        }
    };
    show::exit_code(show.run("Many props", build, |headless| {
        show::wait_for_props(headless)?;
        measure::time_frames(headless, count)
    }))
}
