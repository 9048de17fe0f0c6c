//! The asset loader of fields.

use std::io::Cursor;

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PlenOctree, ReadError};

use super::progress::FilesRead;
use crate::background;

/// Loads `.plenoctree` and `.npz` files as [`PlenOctree`] assets, on threads of its own. Supports hot reloading.
///
/// [`LoadSettings`] supply what the file does not record. The format is detected from the content, so `.npz` files that
/// an asset processor has [packed](crate::PackSaver) load under their original names. Invalid files fail to load with a
/// [`ReadError`].
///
/// The whole file is in memory while it is parsed: those of the included props are about half a megabyte. The web has
/// no threads, so the app freezes there while a file is parsed.
#[derive(TypePath)]
#[type_path = "bevy_plenoctree"]
pub struct PlenOctreeLoader {
    files: FilesRead,
}

impl FromWorld for PlenOctreeLoader {
    fn from_world(world: &mut World) -> Self {
        Self { files: world.get_resource_or_init::<FilesRead>().clone() }
    }
}

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
        let (file, settings) = (context.path().to_string(), settings.clone());
        let mut progress = self.files.watch(context.path().clone());
        let read = progress.read(reader).await;
        let bytes = read.map_err(|error| ReadError::new(&file, error.into()))?;
        background::read(move || PlenOctree::read_from(Cursor::new(bytes), &file, &settings)).await
    }

    fn extensions(&self) -> &[&str] {
        &PlenOctree::EXTENSIONS
    }
}
