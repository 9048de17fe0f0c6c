//! Loading palettes from files: the one next to the field, or one given by a handle.

use std::path::Path;

use bevy::{
    asset::{
        AssetLoader, AssetPath, AssetServerMode, LoadContext, LoadState,
        io::{AssetReaderError, Reader},
    },
    prelude::*,
    tasks::{IoTaskPool, block_on, poll_once},
};
use plenoctree::palette::{Palette, PaletteFileError};

use super::{
    posterized::Posterized,
    ready::PaletteReady,
    resource::{FieldPalette, Palettes},
    source::PaletteSource,
};

/// The extension of palette files: `x.palette.json` belongs to `x.plenoctree` or `x.npz`.
const EXTENSION: &str = "palette.json";

/// Loads `.palette.json` files as [`Palette`] assets. Supports hot reloading.
///
/// Invalid files fail to load with a [`PaletteFileError`].
#[derive(Default, TypePath)]
#[type_path = "bevy_plenoctree"]
pub struct PaletteLoader;

impl AssetLoader for PaletteLoader {
    type Asset = Palette;
    type Settings = ();
    type Error = PaletteFileError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<Palette, PaletteFileError> {
        let path = context.path().path();
        let mut json = Vec::new();
        let read = reader.read_to_end(&mut json).await;
        read.map_err(|source| PaletteFileError::Io { path: path.to_path_buf(), source })?;
        Palette::from_json(&json, path)
    }

    fn extensions(&self) -> &[&str] {
        &[EXTENSION]
    }
}

/// Looks for palette files next to the fields that need a palette and have none.
pub(super) fn seek(mut palettes: ResMut<Palettes>, server: Res<AssetServer>, posterized: Posterized) {
    let palettes = palettes.bypass_change_detection();
    for id in posterized.fields() {
        if palettes.by_field.contains_key(&id) || palettes.files.contains_key(&id) {
            continue;
        }
        let file = server.get_path(id).map_or(PaletteSource::Missing, |field| {
            let path = field.path().with_extension(EXTENSION);
            let path = AssetPath::from_path_buf(path).with_source(field.source().clone_owned());
            let server = AssetServer::clone(&server);
            PaletteSource::Sought(IoTaskPool::get().spawn(async move { exists(&server, &path).await.then_some(path) }))
        });
        palettes.files.insert(id, file);
    }
}

/// Returns whether a file exists. Reads from the asset source, because loading a missing file through the server logs
/// an error.
async fn exists(server: &AssetServer, path: &AssetPath<'_>) -> bool {
    let Ok(source) = server.get_source(path.source()) else {
        return false;
    };
    let reader = match server.mode() {
        AssetServerMode::Unprocessed => source.reader(),
        AssetServerMode::Processed => match source.processed_reader() {
            Ok(reader) => reader,
            Err(_) => return false,
        },
    };
    let path: &Path = path.path();
    match reader.read(path).await.map(drop) {
        Ok(()) => true,
        Err(AssetReaderError::NotFound(_)) => false,
        Err(error) => {
            warn!("failed to read the palette file {}: {error}", path.display());
            false
        }
    }
}

/// Assigns palettes to their fields when they have loaded or changed.
pub(super) fn load(
    mut palettes: ResMut<Palettes>,
    server: Res<AssetServer>,
    loaded: Res<Assets<Palette>>,
    mut changes: MessageReader<AssetEvent<Palette>>,
    mut ready: MessageWriter<PaletteReady>,
) {
    let Palettes { by_field, files, .. } = palettes.bypass_change_detection();
    for event in changes.read() {
        for file in files.values_mut() {
            match file {
                PaletteSource::Loaded(handle) if event.is_modified(&*handle) => {
                    *file = PaletteSource::Changed(handle.clone());
                }
                PaletteSource::Loaded(handle) if event.is_removed(&*handle) => {
                    *file = PaletteSource::Expected(handle.clone());
                }
                PaletteSource::Failed(handle) if event.is_added(&*handle) || event.is_modified(&*handle) => {
                    *file = PaletteSource::Expected(handle.clone());
                }
                _ => {}
            }
        }
    }
    let mut has_arrived = false;
    for (field, file) in files {
        let has_changed = matches!(file, PaletteSource::Changed(_));
        match file {
            PaletteSource::Sought(task) => {
                if let Some(path) = block_on(poll_once(task)) {
                    // If an unapproved path was allowed for the field, it is allowed for the file next to it.
                    let handle = path.map(|path| server.load_builder().override_unapproved().load::<Palette>(path));
                    *file = handle.map_or(PaletteSource::Missing, PaletteSource::Expected);
                }
            }
            PaletteSource::Expected(handle) | PaletteSource::Changed(handle) => {
                if let Some(palette) = loaded.get(&*handle) {
                    let current = by_field.get_mut(field);
                    let mut new = FieldPalette::new(palette.clone());
                    // If a changed file has no shown colors and the same source colors, keep the shown colors.
                    if has_changed
                        && palette.shown.is_empty()
                        && let Some(current) = current.as_ref().filter(|now| now.palette().colors == palette.colors)
                    {
                        new.show(current.shown().iter().copied());
                    }
                    let is_same =
                        |current: &FieldPalette| current.palette() == new.palette() && current.shown() == new.shown();
                    if let Some(current) = current.filter(|current| is_same(current)) {
                        // It is that of the file from now on, even if it was extracted.
                        current.extraction = None;
                    } else {
                        by_field.insert(*field, new);
                        ready.write(PaletteReady { field: *field, sampled: None });
                        has_arrived = true;
                    }
                    *file = PaletteSource::Loaded(handle.clone());
                } else if has_failed(&server, handle) {
                    *file = PaletteSource::Failed(handle.clone());
                }
            }
            PaletteSource::Loaded(_) | PaletteSource::Failed(_) | PaletteSource::Missing => {}
        }
    }
    if has_arrived {
        palettes.set_changed();
    }
}

fn has_failed(server: &AssetServer, handle: &Handle<Palette>) -> bool {
    if *handle == Handle::default() {
        warn!("the handle of a palette is a default one, which nothing loads, expected that of a palette file");
        return true;
    }
    matches!(server.get_load_state(handle), Some(LoadState::Failed(_)))
}
