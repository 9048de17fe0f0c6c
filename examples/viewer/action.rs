//! What the user may ask for, by key, button or drop.

use std::path::PathBuf;

use bevy::prelude::*;

#[derive(Message, Clone, PartialEq, Eq)]
pub enum Action {
    /// Shows another field.
    Open(PathBuf),
    /// Writes colors to a palette's file.
    Save(PathBuf, Colors),
    /// Reads colors from a palette's file.
    Load(PathBuf, Colors),
    /// Moves the camera to where the whole field is in view.
    FrameView,
    /// Writes what the window shows to a file.
    Screenshot,
}

/// Which colors of a field's palette.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Colors {
    /// Those on screen.
    Shown,
    /// Those that labels are assigned by.
    Extracted,
    /// On screen if there are as many as the palette has, a new palette otherwise.
    Either,
}
