//! The message that a palette was loaded or extracted.

use bevy::prelude::*;
use plenoctree::PlenOctree;

use super::resource::Palettes;

/// A message that is written when the palette of a field was extracted or loaded from a file. It is not written for
/// palettes that are [inserted](Palettes::insert).
///
/// Written in [`PreUpdate`], before the palette is first shown. Systems in [`Update`] that read it can still change the
/// colors of the first frame.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteReady, Palettes};
/// fn save(mut ready: MessageReader<PaletteReady>, palettes: Res<Palettes>) -> Result {
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
    /// The field whose palette is ready.
    pub field: AssetId<PlenOctree>,
}

/// Writes a [`PaletteReady`] for every palette that was loaded or extracted since the last call.
pub(super) fn announce(mut palettes: ResMut<Palettes>, mut ready: MessageWriter<PaletteReady>) {
    let arrived = palettes.bypass_change_detection().arrived.drain(..);
    ready.write_batch(arrived.map(|field| PaletteReady { field }));
}
