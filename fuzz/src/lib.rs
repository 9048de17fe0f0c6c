//! What fuzzing holds the file readers of `bevy_plenoctree` to, and the files that it makes.
//!
//! The modules of the crate that know nothing of Bevy are compiled in as they are.

#![forbid(unsafe_code)]

#[path = "../../src/camera/mod.rs"]
pub mod camera;
#[path = "../../src/field/mod.rs"]
pub mod field;
#[allow(unused_imports)]
#[path = "../../src/palette/mod.rs"]
pub mod palette;
#[path = "../../src/reference/mod.rs"]
pub mod reference;

mod cameras;
mod fields;
mod files;
mod palettes;
mod settings;

pub use cameras::{TransformsFile, check_transforms};
pub use fields::check_field;
pub use files::FieldFile;
pub use palettes::{PaletteFile, check_palette};
pub use settings::Settings;

/// Bytes that a message may have, where it does not quote.
const LONGEST_MESSAGE: usize = 1000;
/// Bytes that a quoted one may become.
const LONGEST_ESCAPE: usize = 10;

/// A message is one line. It may quote `quoted` bytes of the file: `serde_json` does not shorten what it found.
fn check_message(error: &dyn std::error::Error, quoted: usize) {
    let message = error.to_string();
    assert!(message.len() < LONGEST_MESSAGE + LONGEST_ESCAPE * quoted, "a message of {} bytes", message.len());
    assert!(!message.contains(char::is_control), "{message:?}");
}

/// A file that is there as long as this.
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
        // Nothing depends on it being gone.
        let _ = std::fs::remove_file(&self.0);
    }
}
