//! The asset loader of fields.

use std::io::Cursor;

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PlenOctree, ReadError};

/// Loads `.npz` files as [`PlenOctree`] assets, off the main thread. Supports hot reloading.
///
/// [`LoadSettings`] specify what the file does not record. The loader keeps all bytes of the file in memory while it
/// loads; [`PlenOctree::read`] streams them instead. Invalid files fail to load with a [`ReadError`].
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
        let file = context.path().to_string();
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|error| ReadError { file: file.clone(), fault: error.into() })?;
        PlenOctree::read_from(Cursor::new(bytes), &file, settings)
    }

    fn extensions(&self) -> &[&str] {
        &["npz"]
    }
}
