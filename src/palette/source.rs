//! Where a field's palette comes from.

use bevy::{asset::AssetPath, prelude::*, tasks::Task};
use plenoctree::palette::Palette;

/// What is known of the file of a field's palette.
pub(super) enum PaletteSource {
    /// Whether there is one beside the field is being found out.
    Sought(Task<Option<AssetPath<'static>>>),
    /// It loads.
    Expected(Handle<Palette>),
    /// It is the field's palette, and will be when it changes.
    Loaded(Handle<Palette>),
    /// There is none.
    Missing,
}
