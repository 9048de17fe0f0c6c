//! Checks for the file readers of `plenoctree`, and generators of files for them to read.

#![forbid(unsafe_code)]

mod cameras;
mod captures;
mod fields;
mod files;
mod packed;
mod palettes;
mod settings;

pub use cameras::{TransformsFile, check_transforms};
pub use captures::{CaptureFile, check_capture};
pub use fields::check_field;
pub use files::FieldFile;
pub use packed::PackedFile;
pub use palettes::{PaletteFile, check_palette};
pub use settings::Settings;

/// The maximum length of an error message in bytes, besides what it quotes.
const LONGEST_MESSAGE: usize = 1000;
/// The maximum number of bytes that one quoted byte may become.
const LONGEST_ESCAPE: usize = 10;

/// Checks that an error message is one line. It may quote `quoted` bytes of the file, because `serde_json` does not
/// shorten its quotes.
fn check_message(error: &dyn std::error::Error, quoted: usize) {
    let message = error.to_string();
    assert!(message.len() < LONGEST_MESSAGE + LONGEST_ESCAPE * quoted, "a message of {} bytes", message.len());
    assert!(!message.contains(char::is_control), "{message:?}");
}

/// A temporary file, which is removed on drop.
struct Scratch(std::path::PathBuf);

impl Scratch {
    fn with(name: &str, content: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_plenoctree-fuzz-{}-{name}", std::process::id()));
        std::fs::write(&path, content).expect("a directory for temporary files");
        Self(path)
    }

    fn path(&self) -> &std::path::Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // It is harmless if this fails.
        let _ = std::fs::remove_file(&self.0);
    }
}
