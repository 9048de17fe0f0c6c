//! An egui panel that edits a prop's palette and settings, for the tools of a game. Requires the feature `egui`.
//!
//! [`PalettePanelPlugin`] shows the panel in a window. To show it elsewhere, leave out the plugin and call
//! [`palette_ui`] from a system in bevy_egui's `EguiPrimaryContextPass`.

mod colors;
mod contents;
mod editor;
mod extraction;
mod posterize;
mod ramps;
mod swatches;
#[cfg(test)]
mod tests;
mod window;

pub use contents::palette_ui;
pub use editor::PaletteEditor;
pub use window::{PalettePanel, PalettePanelPlugin};
