//! The arguments of `look`.

use std::path::PathBuf;

use clap::Args;
use plenoctree_cli::{renderer::Renderer, size::parse_size};

/// Measure the look of a cartoon on fields: how flat it is, how true to the colors, and whether ramps move as a whole.
#[derive(Args)]
pub struct Arguments {
    /// The fields, .npz or .plenoctree files; by default the included props.
    pub fields: Vec<PathBuf>,
    /// The number of views on a turntable.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub views: u32,
    /// Size of the views in pixels.
    #[arg(long, value_name = "WxH", default_value = "800x800", value_parser = parse_size)]
    pub size: (u32, u32),
    /// The number of tones; by default as many as the field needs.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub colors: Option<u32>,
    /// Extract palettes even where a palette file is next to the field.
    #[arg(long)]
    pub extract: bool,
    /// A folder for a sheet of each field: the first view as trained, posterized, and with each ramp recolored in turn.
    #[arg(long)]
    pub sheets: Option<PathBuf>,
    /// The renderer. The reference draws hard edges, unlike the plugin.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: Renderer,
    /// Print only warnings, errors and the table.
    #[arg(long)]
    pub quiet: bool,
}
