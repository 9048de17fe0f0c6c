//! `lab`, the command line tool of the project's own developers. It has one module per subcommand.
#![forbid(unsafe_code)]

mod bake;
mod coherence;
mod evidence;
mod look;
mod packing;
mod plot;
mod recolor;
mod report;
mod steady;
mod tradeoff;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use plenoctree_cli::{console, files, result::Result};

/// Measure what the docs of the project report, and bake its props.
#[derive(Parser)]
#[command(name = "lab", version)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

/// The subcommands, which are described by their arguments.
#[derive(Subcommand)]
enum Command {
    Tradeoff(tradeoff::Arguments),
    Coherence(coherence::Arguments),
    Evidence(evidence::Arguments),
    Look(look::Arguments),
    Packing(packing::Arguments),
    Steady(steady::Arguments),
    Bake(bake::Arguments),
}

impl CommandLine {
    /// Runs the subcommand. If it fails, it leaves nothing unfinished behind.
    fn run(&self) -> Result {
        self.finish().inspect_err(|_| files::clean_up())
    }

    fn finish(&self) -> Result {
        match &self.command {
            Command::Tradeoff(arguments) => tradeoff::run(arguments),
            Command::Coherence(arguments) => coherence::run(arguments),
            Command::Evidence(arguments) => evidence::run(arguments),
            Command::Look(arguments) => look::run(arguments),
            Command::Packing(arguments) => packing::run(arguments),
            Command::Steady(arguments) => steady::run(arguments),
            Command::Bake(arguments) => bake::run(arguments),
        }
    }
}

fn main() -> ExitCode {
    console::exit(CommandLine::parse().run())
}
