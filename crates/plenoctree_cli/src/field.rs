//! Finds and reads the field that a command works on.

use std::path::{Path, PathBuf};

use plenoctree::{LoadSettings, PlenOctree};

use crate::{progress, result::Result};

/// The default field, relative to the root of the workspace.
const DEFAULT: &str = "assets/toadstool.plenoctree";

/// Returns the given path, or by default the path of the toadstool: in the workspace in which this program was built
/// or, if that no longer exists, under the current directory.
pub fn or_default(path: Option<&Path>) -> PathBuf {
    let in_workspace = || {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2)?;
        Some(workspace.join(DEFAULT)).filter(|path| path.exists())
    };
    path.map(Path::to_path_buf).or_else(in_workspace).unwrap_or_else(|| DEFAULT.into())
}

/// Reads a field, with a spinner unless `quiet`.
pub fn load(path: &Path, quiet: bool) -> Result<PlenOctree> {
    let spinner = progress::spinner("loading", quiet);
    let field = PlenOctree::read(path, &LoadSettings::default())?;
    spinner.finish_and_clear();
    Ok(field)
}
