//! The state of a field's palette file.

use bevy::{asset::AssetPath, prelude::*, tasks::Task};
use plenoctree::palette::Palette;

/// The state of the file that a field's palette is loaded from.
pub(super) enum PaletteSource {
    /// A task is looking for a palette file next to the field.
    Sought(Task<Option<AssetPath<'static>>>),
    /// The palette is loading.
    Expected(Handle<Palette>),
    /// The palette was assigned to the field, and its file has changed.
    Changed(Handle<Palette>),
    /// The palette is loaded and assigned to the field. If the asset changes, it is assigned again.
    Loaded(Handle<Palette>),
    /// The palette failed to load. If the file is mended, it is assigned to the field.
    Failed(Handle<Palette>),
    /// There is no palette file.
    Missing,
}
