//! How much of each file has been read.

use std::{
    collections::HashMap,
    io::{self, SeekFrom},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bevy::{
    asset::{AssetPath, io::Reader},
    prelude::*,
    tasks::futures_lite::{AsyncReadExt, AsyncSeekExt},
};

/// The number of bytes after which progress is counted.
const CHUNK: usize = 1 << 18;

/// The files that are being read, and the fraction of each that has been.
#[derive(Resource, Clone, Default)]
pub(crate) struct FilesRead(Arc<Mutex<HashMap<AssetPath<'static>, f32>>>);

impl FilesRead {
    /// Returns the fraction of a file that has been read, from 0 to 1, or `None` if it is not being read.
    pub fn share(&self, file: &AssetPath<'static>) -> Option<f32> {
        self.files().get(file).copied()
    }

    /// Watches a file until the result is dropped.
    pub(super) fn watch(&self, file: AssetPath<'static>) -> FileRead {
        self.files().insert(file.clone(), 0.0);
        FileRead { files: self.clone(), file }
    }

    fn files(&self) -> MutexGuard<'_, HashMap<AssetPath<'static>, f32>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A file that is being read.
pub(super) struct FileRead {
    files: FilesRead,
    file: AssetPath<'static>,
}

impl FileRead {
    /// Reads the whole file. Counts its parts as they arrive, if the asset source knows its length.
    pub async fn read(&mut self, reader: &mut dyn Reader) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        if let Ok(file) = reader.seekable() {
            let length = file.seek(SeekFrom::End(0)).await?;
            file.seek(SeekFrom::Start(0)).await?;
            bytes.reserve_exact(usize::try_from(length).unwrap_or_default());
            while (&mut *file).take(CHUNK as u64).read_to_end(&mut bytes).await? > 0 {
                let share = (bytes.len() as f64 / length.max(1) as f64).min(1.0) as f32;
                self.files.files().insert(self.file.clone(), share);
            }
        } else {
            reader.read_to_end(&mut bytes).await?;
        }
        self.files.files().insert(self.file.clone(), 1.0);
        Ok(bytes)
    }
}

impl Drop for FileRead {
    fn drop(&mut self) {
        self.files.files().remove(&self.file);
    }
}
