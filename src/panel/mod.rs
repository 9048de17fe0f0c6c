//! A panel for a game's own tools, to change a prop's palette and its settings: with egui, behind the feature `egui`.
//!
//! [`PalettePanelPlugin`] shows it in a window. To put it anywhere else, leave the plugin out and call [`palette_ui`]
//! from a system of bevy_egui's `EguiPrimaryContextPass`.

mod contents;
mod editor;
mod extraction;
mod posterize;
mod swatches;
#[cfg(test)]
mod tests;
mod window;

pub use contents::palette_ui;
pub use editor::PaletteEditor;
pub use window::{PalettePanel, PalettePanelPlugin};
