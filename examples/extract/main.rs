//! A field arrives while the game runs, its palette is extracted in compute shaders, and the game animates it at once.
//!
//! ```sh
//! cargo run --release --example extract
//! cargo run --release --example extract -- --headless palette.png --at-frame 90
//! ```

mod scene;
#[path = "../common/show.rs"]
mod show;

use clap::Parser;

/// Shows a palette from its extraction to its animation.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    show: show::Show,
}

fn main() -> std::process::ExitCode {
    show::exit_code(Arguments::parse().show.run("A palette forms", scene::build, |headless| {
        (0..scene::ARRIVAL).for_each(|_| headless.update());
        show::wait_for_props(headless)
    }))
}
