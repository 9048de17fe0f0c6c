//! Quality presets on the command line.

use clap::ValueEnum;

/// A quality preset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// Exact.
    #[default]
    Exact,
    /// Hardly distinguishable from exact.
    High,
    /// A compromise for most games.
    Balanced,
    /// For a slow GPU. Crowds of tiny props gain nothing.
    Fast,
}
