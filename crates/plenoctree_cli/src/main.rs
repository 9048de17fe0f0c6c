//! `plenoctree`, a command line tool for PlenOctrees.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use clap::Parser;
use plenoctree_cli::{command::CommandLine, console};

fn main() -> ExitCode {
    console::exit(CommandLine::parse().run())
}
