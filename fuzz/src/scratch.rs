//! Temporary files and folders.

/// A temporary file, which is removed on drop.
pub struct Scratch(std::path::PathBuf);

impl Scratch {
    pub fn with(name: &str, content: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_plenoctree-fuzz-{}-{name}", std::process::id()));
        std::fs::write(&path, content).expect("a directory for temporary files");
        Self(path)
    }

    pub fn path(&self) -> &std::path::Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // It is harmless if this fails.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// A temporary folder, which is removed on drop.
pub struct ScratchFolder(std::path::PathBuf);

impl ScratchFolder {
    /// Creates an empty folder.
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_plenoctree-fuzz-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir(&path).expect("a directory for temporary files");
        Self(path)
    }

    pub fn path(&self) -> &std::path::Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // It is harmless if this fails.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
