//! The command line tool `plenoctree`. It has one module per subcommand, and small shared modules.
//!
//! This library is not an interface for other programs: it only lets the project's own tool `lab` use what `plenoctree`
//! uses.
#![forbid(unsafe_code)]

mod boxes;
mod capture;
pub mod command;
pub mod console;
mod convert;
pub mod extraction;
pub mod field;
pub mod files;
mod fit;
mod gpu_memory;
pub mod hex;
mod info;
mod names;
pub mod number;
pub mod pack;
mod palette;
pub mod preset;
pub mod progress;
mod ramps;
mod render;
pub mod renderer;
pub mod result;
pub mod size;
mod stylize;
mod swatches;
mod text;
mod training;
pub mod transforms;
pub mod turntable;
