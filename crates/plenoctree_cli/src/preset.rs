//! Quality presets on the command line.

use clap::ValueEnum;

/// How exactly the GPU draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// What the method asks for.
    #[default]
    Exact,
    /// Hardly distinguishable from exact.
    High,
    /// For most games.
    Balanced,
    /// For many props, or slow graphics cards.
    Fast,
}
