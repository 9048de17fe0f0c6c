//! How much of each file has been read.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bevy::{asset::AssetPath, prelude::*};

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
        FileRead { files: self.clone(), file, bytes: 0 }
    }

    fn files(&self) -> MutexGuard<'_, HashMap<AssetPath<'static>, f32>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A file that is being read.
pub(super) struct FileRead {
    files: FilesRead,
    file: AssetPath<'static>,
    bytes: u64,
}

impl FileRead {
    /// Counts bytes of a file of `length` bytes as read. Only a few are read twice.
    pub fn count(&mut self, bytes: usize, length: u64) {
        self.bytes += bytes as u64;
        let share = (self.bytes as f64 / length.max(1) as f64).min(1.0) as f32;
        self.files.files().insert(self.file.clone(), share);
    }
}

impl Drop for FileRead {
    fn drop(&mut self) {
        self.files.files().remove(&self.file);
    }
}
