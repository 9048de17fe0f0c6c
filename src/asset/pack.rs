//! Packs fields in the asset processor.

use std::sync::Arc;

use bevy::{
    asset::{
        AssetPath, AsyncWriteExt,
        io::Writer,
        processor::LoadTransformAndSave,
        saver::{AssetSaver, SavedAsset},
        transformer::IdentityAssetTransformer,
    },
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PackSettings, Packed, PlenOctree, sampling::Progress};

#[cfg(feature = "splat")]
use super::capture::{CaptureLoader, EXTENSIONS};
use super::{loader::PlenOctreeLoader, turn::turn};
use crate::background::{self, on_cores};

/// Packs the fields of an app whose [`AssetMode`] is [`Processed`](AssetMode::Processed), so that the game ships small
/// files without a manual step. [`PlenOctreePlugin`](crate::PlenOctreePlugin) makes it the default for `.npz` files if
/// the feature `pack` is enabled, and for captures (`.ply`, `.spz`, `.sog` and `.splat` files) if the feature `splat`
/// is, too.
///
/// A file's `.meta` file can set its [`PackSettings`] and the settings of its loader, or convert a capture in another
/// kind of file, such as glTF, to a field. Loading is unchanged: the paths of the source file and of the palette next
/// to it stay the same.
#[derive(Default, TypePath)]
#[type_path = "bevy_plenoctree"]
pub struct PackSaver;

impl AssetSaver for PackSaver {
    type Asset = PlenOctree;
    type Settings = PackSettings;
    type OutputLoader = PlenOctreeLoader;
    type Error = BevyError;

    async fn save(
        &self,
        writer: &mut Writer,
        asset: SavedAsset<'_, '_, PlenOctree>,
        settings: &PackSettings,
        path: AssetPath<'_>,
    ) -> Result<LoadSettings, BevyError> {
        let (field, settings, path) = (asset.get().clone(), settings.clone(), path.to_string());
        // If the app exits, the task is dropped, which cancels the work.
        let progress = Arc::new(Progress::default());
        let guard = CancelOnDrop(progress.clone());
        let pack = move || {
            field.density_losses().for_each(|loss| warn!("{path}: {loss}"));
            on_cores(|| Packed::new(&field, &settings, &progress))
        };
        let turn = turn().await;
        let packed = background::spawn(pack).await?;
        drop((guard, turn));
        writer.write_all(packed.bytes()).await?;
        // The file now records what the source's settings said: its activation, its up axis and the leaves to keep.
        Ok(LoadSettings { density_threshold: 0.0, ..default() })
    }
}

struct CancelOnDrop(Arc<Progress>);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// Loads a field and saves it packed.
type PackProcessor = LoadTransformAndSave<PlenOctreeLoader, IdentityAssetTransformer<PlenOctree>, PackSaver>;

/// Converts a capture to a field and saves it packed.
#[cfg(feature = "splat")]
type CaptureProcessor = LoadTransformAndSave<CaptureLoader, IdentityAssetTransformer<PlenOctree>, PackSaver>;

/// Registers the processors for captures and for fields that are not packed.
pub(crate) fn register(app: &mut App) {
    app.register_asset_processor(PackProcessor::from(PackSaver)).set_default_asset_processor::<PackProcessor>("npz");
    #[cfg(feature = "splat")]
    {
        app.register_asset_processor(CaptureProcessor::from(PackSaver));
        for extension in EXTENSIONS {
            app.set_default_asset_processor::<CaptureProcessor>(extension);
        }
    }
}

#[cfg(test)]
mod tests;
