//! `plenoctree`, a command line tool for PlenOctrees. It has one module per subcommand, and small shared modules.
#![forbid(unsafe_code)]

mod bake;
mod boxes;
mod capture;
mod coherence;
mod command;
mod console;
mod convert;
mod evidence;
mod extraction;
mod field;
mod files;
mod fit;
mod gpu_memory;
mod hex;
mod info;
mod number;
mod pack;
mod palette;
mod plot;
mod preset;
mod progress;
mod recolor;
mod render;
mod renderer;
mod result;
mod size;
mod stylize;
mod swatches;
mod text;
#[cfg(feature = "bevy")]
mod tradeoff;
mod training;
mod transforms;
mod turntable;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    match command::CommandLine::parse().run().and_then(|()| console::check()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::complain!("error: {error}");
            ExitCode::from(2)
        }
    }
}
