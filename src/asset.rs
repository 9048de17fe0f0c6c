//! The field as a Bevy asset.

use std::io::Cursor;

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PlenOctree, ReadError};

/// Loads `.npz` files as [`PlenOctree`]s, off the main thread, hot reload included.
///
/// The file's bytes are in memory while it loads; [`PlenOctree::read`] streams them instead. [`LoadSettings`] say what
/// the file cannot.
#[derive(Default, TypePath)]
pub struct PlenOctreeLoader;

impl AssetLoader for PlenOctreeLoader {
    type Asset = PlenOctree;
    type Settings = LoadSettings;
    type Error = ReadError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &LoadSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<PlenOctree, ReadError> {
        let label = context.path().to_string();
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|error| ReadError { file: label.clone(), fault: error.into() })?;
        PlenOctree::read_from(Cursor::new(bytes), &label, settings)
    }

    fn extensions(&self) -> &[&str] {
        &["npz"]
    }
}
