//! How much of each file has been read.

use std::{
    collections::HashMap,
    io::{self, SeekFrom},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicU32, Ordering},
    },
};

use bevy::{
    asset::{AssetPath, io::Reader},
    prelude::*,
    tasks::futures_lite::{AsyncReadExt, AsyncSeekExt},
};

/// The number of bytes that are read at once, after which progress is counted.
const CHUNK: usize = 1 << 18;

/// The files that are being read, and the fraction of each that has been. A file may be read several times at once, with
/// other settings.
#[derive(Resource, Clone, Default)]
pub(crate) struct FilesRead(Arc<Mutex<Watched>>);

/// How much of each file has been read, while it is.
type Watched = HashMap<AssetPath<'static>, Vec<Weak<Share>>>;

/// A fraction from 0 to 1, as bits.
type Share = AtomicU32;

impl FilesRead {
    /// Returns the fraction of a file that has been read, from 0 to 1, or `None` if it is not being read.
    pub fn share(&self, file: &AssetPath<'static>) -> Option<f32> {
        let share = |share: &Weak<Share>| Some(f32::from_bits(share.upgrade()?.load(Ordering::Relaxed)));
        self.files().get(file)?.iter().filter_map(share).reduce(f32::min)
    }

    /// Watches a file until the result is dropped.
    pub(super) fn watch(&self, file: AssetPath<'static>) -> FileRead {
        let share = Arc::<Share>::default();
        let mut files = self.files();
        files.retain(|_, shares| {
            shares.retain(|share| share.strong_count() > 0);
            !shares.is_empty()
        });
        files.entry(file).or_default().push(Arc::downgrade(&share));
        FileRead(share)
    }

    fn files(&self) -> MutexGuard<'_, Watched> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A file that is being read.
pub(super) struct FileRead(Arc<Share>);

impl FileRead {
    /// Reads the whole file. Counts its parts as they arrive, if the asset source knows its length.
    pub async fn read(&mut self, reader: &mut dyn Reader) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        if let Ok(file) = reader.seekable() {
            let length = file.seek(SeekFrom::End(0)).await?;
            file.seek(SeekFrom::Start(0)).await?;
            bytes.reserve_exact(usize::try_from(length).unwrap_or_default());
            // `read_to_end` would fill all of the memory that is left with zeros, for every chunk.
            let mut chunk = vec![0; CHUNK];
            loop {
                let read = file.read(&mut chunk).await?;
                if read == 0 {
                    break;
                }
                bytes.extend_from_slice(&chunk[..read]);
                let share = (bytes.len() as f64 / length.max(1) as f64).min(1.0) as f32;
                self.0.store(share.to_bits(), Ordering::Relaxed);
            }
        } else {
            reader.read_to_end(&mut bytes).await?;
        }
        self.0.store(1f32.to_bits(), Ordering::Relaxed);
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use bevy::{asset::io::VecReader, tasks::block_on};

    use super::*;

    /// Nor does reading take more memory than the file.
    #[test]
    fn whole_files_are_read() {
        for length in [0, 1, CHUNK, 3 * CHUNK + 5] {
            let file: Vec<u8> = (0..length).map(|index| (index % 251) as u8).collect();
            let files = FilesRead::default();
            let path = AssetPath::from("toy.npz");
            let mut watched = files.watch(path.clone());
            let bytes = block_on(watched.read(&mut VecReader::new(file.clone()))).unwrap();
            assert!(bytes == file && bytes.capacity() == length);
            assert_eq!(files.share(&path), Some(1.0));
        }
    }

    #[test]
    fn the_slowest_of_several_counts() {
        let (files, path) = (FilesRead::default(), AssetPath::from("toy.npz"));
        let mut first = files.watch(path.clone());
        let second = files.watch(path.clone());
        block_on(first.read(&mut VecReader::new(vec![7; 9]))).unwrap();
        assert_eq!(files.share(&path), Some(0.0));
        drop(second);
        assert_eq!(files.share(&path), Some(1.0));
        drop(first);
        assert_eq!(files.share(&path), None);
    }
}
