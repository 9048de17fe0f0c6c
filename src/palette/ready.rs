//! The news that there is a palette.

use bevy::prelude::*;
use plenoctree::PlenOctree;

use super::resource::Palettes;

/// Says that a field has got a palette: one that was extracted, or one that came from a file. Palettes that are
/// [inserted](Palettes::insert) are no news.
///
/// It is written in [`PreUpdate`], before the palette is first shown: a system of [`Update`] that reads it can still
/// change the colors of the very first picture.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteReady, Palettes};
/// fn keep(mut ready: MessageReader<PaletteReady>, palettes: Res<Palettes>) -> Result {
///     for PaletteReady { field } in ready.read() {
///         if let Some(palette) = palettes.get(*field).filter(|palette| palette.extraction().is_some()) {
///             palette.save("assets/toadstool.palette.json")?;
///         }
///     }
///     Ok(())
/// }
/// ```
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaletteReady {
    /// The field that has a palette now.
    pub field: AssetId<PlenOctree>,
}

pub(super) fn announce(mut palettes: ResMut<Palettes>, mut ready: MessageWriter<PaletteReady>) {
    let arrived = palettes.bypass_change_detection().arrived.drain(..);
    ready.write_batch(arrived.map(|field| PaletteReady { field }));
}
