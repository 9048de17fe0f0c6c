//! The command line and its subcommands.

use clap::{Parser, Subcommand};

use crate::{convert, files, fit, info, pack, palette, ramps, render, result::Result, stylize, training::Interruption};

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
    /// Runs the subcommand. If it fails or is stopped, it leaves nothing unfinished behind.
    pub fn run(&self) -> Result {
        // The others have results to keep if Ctrl-C stops them.
        if !matches!(self.command, Command::Fit(_) | Command::Convert(_)) {
            Interruption::new(files::clean_up)?;
        }
        self.finish().inspect_err(|_| files::clean_up())
    }

    fn finish(&self) -> Result {
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
