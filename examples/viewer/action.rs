//! Actions that the user triggers with keys, buttons or dropped files.

use std::path::PathBuf;

use bevy::prelude::*;

/// The keys that the panel lists.
pub const KEYS: [(&str, &str); 6] = [
    ("F", "frame the field"),
    ("P", "toggle posterization"),
    ("H", "toggle the panel"),
    ("F12", "take a screenshot"),
    ("Ctrl+S", "save the shown colors"),
    ("Ctrl+O", "load the shown colors"),
];

#[derive(Message, Clone, PartialEq, Eq)]
pub enum Action {
    /// Shows another field.
    Open(PathBuf),
    /// Saves colors to a palette file.
    Save(PathBuf, Colors),
    /// Loads colors from a palette file.
    Load(PathBuf, Colors),
    /// Moves the camera so that the whole field is in view.
    FrameView,
    /// Saves a screenshot of the window.
    Screenshot,
}

/// The colors of a field's palette that an action applies to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Colors {
    /// The shown colors.
    Shown,
    /// The palette: its source colors, and those that it shows.
    Source,
    /// The shown colors if the file has as many colors as the palette, otherwise the source colors of a new palette.
    Either,
}
