//! The asset loader of fields.

use std::io::Cursor;

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PlenOctree, ReadError};

use super::progress::FilesRead;
#[cfg(not(target_arch = "wasm32"))]
use super::remote;
use crate::background;

/// Loads `.plenoctree` and `.npz` files as [`PlenOctree`] assets, on a dedicated thread. Supports hot reloading.
///
/// [`LoadSettings`] supply what the file does not record. The format is detected from the content, so `.npz` files that
/// an asset processor has [packed](crate::PackSaver) load under their original names. Invalid files fail to load with a
/// [`ReadError`].
///
/// The file is parsed while it is read, so only a part of it is in memory at any time. Asset sources that cannot seek,
/// such as compressed archives, and all sources on the web return the whole file at once instead. The web has no
/// threads, so the app freezes there while a file is parsed.
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
        let failed = |error: std::io::Error| ReadError { file: file.clone(), fault: error.into() };
        let mut progress = self.files.watch(context.path().clone());
        #[cfg(not(target_arch = "wasm32"))]
        if let Ok(reader) = reader.seekable() {
            let label = file.clone();
            let parse = move |remote| PlenOctree::read_from(remote, &label, &settings);
            return remote::serve(reader, parse, |bytes, length| progress.count(bytes, length))
                .await
                .map_err(failed)?;
        }
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(failed)?;
        progress.count(bytes.len(), bytes.len() as u64);
        background::spawn(move || PlenOctree::read_from(Cursor::new(bytes), &file, &settings)).await
    }

    fn extensions(&self) -> &[&str] {
        &PlenOctree::EXTENSIONS
    }
}
