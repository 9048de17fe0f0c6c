//! A panel for a game's own tools, to change a prop's palette and look: with egui, behind the feature `egui`.
//!
//! [`PalettePanelPlugin`] shows it in a window. To put it anywhere else, leave the plugin out and call [`palette_ui`]
//! from a system of bevy_egui's `EguiPrimaryContextPass`.

mod editor;
mod extraction;
mod look;
mod swatches;
#[cfg(test)]
mod tests;
mod window;

pub use editor::{PaletteEditor, palette_ui};
pub use window::{PalettePanel, PalettePanelPlugin};
