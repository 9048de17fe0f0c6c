//! Reads files without trusting what they claim: shared by the readers of pictures' cameras and of captures.
#![cfg_attr(
    not(all(feature = "fit", feature = "splat")),
    allow(dead_code, unused_imports, reason = "cameras or captures need only some of it")
)]

mod bytes;
mod fault;
pub mod ply;

pub use bytes::{Bytes, Number};
pub use fault::{Fault, printable};

/// Returns the text of a file without the byte order mark that some editors write.
pub fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}
