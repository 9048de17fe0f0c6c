//! Messages: a palette was loaded or extracted, or could not be extracted.

use bevy::prelude::*;
use plenoctree::{PlenOctree, palette::ExtractionError};

use super::samples::SampleOrigin;

/// A message that is written when the palette of a field has been extracted or loaded from a file. It is not written
/// for palettes that are [inserted](crate::Palettes::insert).
///
/// Written in [`PreUpdate`], before the palette is first shown. Systems in [`Update`] that read it can still change the
/// colors of the first frame.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PaletteReady, Palettes, PlenOctreePlugin};
/// fn save(mut ready: MessageReader<PaletteReady>, palettes: Res<Palettes>) -> Result {
///     for ready in ready.read().filter(|ready| ready.sampled.is_some()) {
///         if let Some(palette) = palettes.get(ready.field) {
///             palette.save("assets/toadstool.palette.json")?;
///         }
///     }
///     Ok(())
/// }
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, save).update();
/// ```
#[derive(Message, Clone, Copy, Debug, PartialEq, Eq)]
pub struct PaletteReady {
    /// The field whose palette is ready.
    pub field: AssetId<PlenOctree>,
    /// Where the field was sampled, or `None` if the palette was loaded from a file.
    pub sampled: Option<SampleOrigin>,
}

/// A message that is written in [`PreUpdate`] when no palette could be extracted from a field. Its posterized and
/// recolored props are drawn as trained, unless they have an earlier palette.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct PaletteFailed {
    /// The field.
    pub field: AssetId<PlenOctree>,
    /// The reason.
    pub error: ExtractionError,
}
