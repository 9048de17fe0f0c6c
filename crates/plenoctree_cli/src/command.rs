//! The command line and its subcommands.

use clap::{Parser, Subcommand};

use crate::{convert, fit, info, pack, palette, ramps, render, result::Result, stylize};

/// Inspect, stylize, fit, convert and pack PlenOctrees.
#[derive(Parser)]
#[command(name = "plenoctree", version)]
pub struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

/// The subcommands, which are described by their arguments.
#[derive(Subcommand)]
enum Command {
    Info(info::Arguments),
    Palette(palette::Arguments),
    Ramps(ramps::Arguments),
    Stylize(stylize::Arguments),
    Fit(fit::Arguments),
    Convert(convert::Arguments),
    Render(render::Arguments),
    Pack(pack::Arguments),
}

impl CommandLine {
    /// Runs the subcommand.
    pub fn run(&self) -> Result {
        match &self.command {
            Command::Info(arguments) => info::run(arguments),
            Command::Palette(arguments) => palette::run(arguments),
            Command::Ramps(arguments) => ramps::run(arguments),
            Command::Stylize(arguments) => stylize::run(arguments),
            Command::Fit(arguments) => fit::run(arguments),
            Command::Convert(arguments) => convert::run(arguments),
            Command::Render(arguments) => render::run(arguments),
            Command::Pack(arguments) => pack::run(arguments),
        }
    }
}
