//! Which field a command works on, and reading it.

use std::path::{Path, PathBuf};

use plenoctree::{LoadSettings, PlenOctree};

use crate::{Result, progress};

/// The field that is used when none is named, relative to the root of the workspace.
const DEFAULT: &str = "assets/toadstool.npz";

/// The path that was given, or that of the toadstool: in the workspace that this program was built in, or, if that is
/// gone, under the current directory.
pub fn or_default(path: Option<&Path>) -> PathBuf {
    let in_workspace = || {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2)?;
        Some(workspace.join(DEFAULT)).filter(|path| path.exists())
    };
    path.map(Path::to_path_buf).or_else(in_workspace).unwrap_or_else(|| DEFAULT.into())
}

/// Reads a field while a spinner turns.
pub fn load(path: &Path, quiet: bool) -> Result<PlenOctree> {
    let spinner = progress::spinner("loading", quiet);
    let field = PlenOctree::read(path, &LoadSettings::default())?;
    spinner.finish_and_clear();
    Ok(field)
}
