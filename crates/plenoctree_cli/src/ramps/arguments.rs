//! The arguments of `ramps`.

use std::path::PathBuf;

use clap::Args;

use super::edit::{self, Edit};

/// List the ramps of a palette, and rename, merge or split them.
#[derive(Args)]
pub struct Arguments {
    /// The palette, a .json file.
    pub palette: PathBuf,
    /// Ramps as they should be: `cap=red` renames the ramp `red`, `brass=yellow,brown` merges two, and `iron=3,7` moves
    /// palette colors 3 and 7. One after another.
    #[arg(value_name = "NAME=RAMP|INDEX,..", value_parser = edit::parse)]
    pub edits: Vec<Edit>,
    /// The file to save the changed palette to; by default the palette itself.
    #[arg(long, value_name = "FILE.json", requires = "edits")]
    pub out: Option<PathBuf>,
    /// The file to save an image of the palette to.
    #[arg(long, value_name = "FILE.png")]
    pub image: Option<PathBuf>,
}
