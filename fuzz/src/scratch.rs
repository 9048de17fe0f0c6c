//! Temporary files.

use std::path::{Path, PathBuf};

/// A temporary folder, which is removed on drop.
pub struct Scratch(PathBuf);

impl Scratch {
    /// Creates an empty folder.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_plenoctree-fuzz-{}-{name}", std::process::id()));
        // It is there if a run was interrupted.
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir(&path).expect("a directory for temporary files");
        Self(path)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Writes a file into the folder, and returns its path.
    pub fn file(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, content).expect("a directory for temporary files");
        path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // It is harmless if this fails.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
