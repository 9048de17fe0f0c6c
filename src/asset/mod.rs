//! The asset loader of fields.

#[cfg(feature = "pack")]
mod pack;
mod progress;
#[cfg(not(target_arch = "wasm32"))]
mod remote;

pub(crate) use progress::FilesRead;

use std::io::Cursor;

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PlenOctree, ReadError};

#[cfg(feature = "pack")]
pub use pack::PackSaver;
#[cfg(feature = "pack")]
pub(crate) use pack::register as register_processor;

use crate::background;

/// Loads `.plenoctree` and `.npz` files as [`PlenOctree`] assets, on a thread of its own. Supports hot reloading.
///
/// [`LoadSettings`] specify what the file does not record. The content decides what a file is, so that `.npz` files that an
/// asset processor has [packed](crate::PackSaver) load under their own names. Invalid files fail to load with a [`ReadError`].
///
/// The file is parsed while it is read, so that only a part of it is in memory at any time. Asset sources that cannot
/// seek, such as archives that inflate their files, and all sources on the web, give the whole file at once instead. On
/// the web, which has no threads, the app stops while a file is parsed.
#[derive(TypePath)]
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
        &["plenoctree", "npz"]
    }
}
