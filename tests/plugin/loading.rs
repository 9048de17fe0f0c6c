//! Tests that loading and extraction leave the app's task pools and memory alone.

use std::{
    io::{self, SeekFrom},
    path::Path,
    pin::Pin,
    sync::{
        Arc, Barrier, LazyLock,
        atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed},
    },
    task::{Context, Poll, ready},
    time::{Duration, Instant},
};

use bevy::{
    asset::{
        LoadState,
        io::{
            AssetReader, AssetReaderError, AssetSourceBuilder, PathStream, Reader, ReaderNotSeekableError,
            SeekableReader, SliceReader, VecReader,
        },
    },
    prelude::*,
    tasks::{
        AsyncComputeTaskPool, IoTaskPool, TaskPool,
        futures_lite::io::{AsyncRead, AsyncSeek},
    },
};
use bevy_plenoctree::{PaletteExtraction, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop};
use cpu_time::ThreadTime;
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

use super::stage::wait_for;

/// A ball of half a million leaves, as a file. Parsing it takes a large part of a second, and extracting its palette
/// takes seconds.
static LARGE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let settings = BakeSettings { depth: 7, basis: Basis::Sh9, directions: 9, density_samples: 1, ..default() };
    let density = |at: DVec3| if (0.45..0.78).contains(&at.length()) { 0.5 } else { 0.0 };
    let field = bake(&settings, density, |at| move |_: DVec3| 0.5 + 0.4 * (9.0 * at).map(f64::sin)).unwrap();
    let mut bytes = io::Cursor::new(Vec::new());
    field.write_to(&mut bytes).unwrap();
    bytes.into_inner()
});

/// How the files of a source are read.
#[derive(Clone, Default)]
struct Watched {
    seekable: bool,
    /// The number of times that a whole file was requested.
    wholes: Arc<AtomicUsize>,
    /// The largest number of bytes that were requested at once.
    most: Arc<AtomicUsize>,
    /// The number of bytes that were read.
    read: Arc<AtomicU64>,
    /// The number of bytes after which reading fails.
    ends: Option<u64>,
}

impl AssetReader for Watched {
    async fn read<'a>(&'a self, _: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        Ok(WatchedReader { inner: SliceReader::new(&LARGE), waits: false, watched: self.clone() })
    }

    async fn read_meta<'a>(&'a self, path: &'a Path) -> Result<impl Reader + 'a, AssetReaderError> {
        Err::<VecReader, _>(AssetReaderError::NotFound(path.into()))
    }

    async fn read_directory<'a>(&'a self, path: &'a Path) -> Result<Box<PathStream>, AssetReaderError> {
        Err(AssetReaderError::NotFound(path.into()))
    }

    async fn is_directory<'a>(&'a self, _: &'a Path) -> Result<bool, AssetReaderError> {
        Ok(false)
    }
}

struct WatchedReader {
    inner: SliceReader<'static>,
    waits: bool,
    watched: Watched,
}

impl AsyncRead for WatchedReader {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context, buffer: &mut [u8]) -> Poll<io::Result<usize>> {
        if self.watched.ends.is_some_and(|end| self.watched.read.load(Relaxed) >= end) {
            return Poll::Ready(Err(io::Error::other("the cable was pulled")));
        }
        self.watched.most.fetch_max(buffer.len(), Relaxed);
        // As when bytes arrive from elsewhere, other tasks get their turn between two parts.
        self.waits = !self.waits;
        if self.waits {
            context.waker().wake_by_ref();
            return Poll::Pending;
        }
        let count = ready!(Pin::new(&mut self.inner).poll_read(context, buffer))?;
        self.watched.read.fetch_add(count as u64, Relaxed);
        Poll::Ready(Ok(count))
    }
}

impl AsyncSeek for WatchedReader {
    fn poll_seek(mut self: Pin<&mut Self>, context: &mut Context, to: SeekFrom) -> Poll<io::Result<u64>> {
        Pin::new(&mut self.inner).poll_seek(context, to)
    }
}

impl Reader for WatchedReader {
    fn read_to_end<'a>(
        &'a mut self,
        buffer: &'a mut Vec<u8>,
    ) -> bevy::asset::io::StackFuture<'a, io::Result<usize>, { bevy::asset::io::STACK_FUTURE_SIZE }> {
        self.watched.wholes.fetch_add(1, Relaxed);
        self.inner.read_to_end(buffer)
    }

    fn seekable(&mut self) -> Result<&mut dyn SeekableReader, ReaderNotSeekableError> {
        if self.watched.seekable { Ok(self) } else { Err(ReaderNotSeekableError) }
    }
}

/// An app without a window that has `watched` as an asset source.
fn app(watched: &Watched) -> App {
    let mut app = App::new();
    let watched = watched.clone();
    let source = AssetSourceBuilder::new(move || Box::new(watched.clone()));
    app.register_asset_source("watched", source);
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    app.finish();
    app.cleanup();
    app
}

fn load(app: &App, index: usize) -> Handle<PlenOctree> {
    app.world().resource::<AssetServer>().load(format!("watched://{index}.npz"))
}

/// Updates the app until every field is loaded, or one has failed.
fn wait(app: &mut App, fields: &[Handle<PlenOctree>]) -> Result<(), String> {
    let mut error = None;
    wait_for("fields", || {
        app.update();
        let states = fields.iter().map(|field| app.world().resource::<AssetServer>().load_state(field));
        let states: Vec<_> = states.collect();
        if let Some(LoadState::Failed(failure)) = states.iter().find(|state| state.is_failed()) {
            error = Some(failure.to_string());
        }
        error.is_some() || states.iter().all(LoadState::is_loaded)
    });
    error.map_or(Ok(()), Err)
}

#[test]
fn files_are_read_in_parts() {
    let watched = Watched { seekable: true, ..default() };
    let mut app = app(&watched);
    let field = load(&app, 0);
    wait(&mut app, std::slice::from_ref(&field)).unwrap();
    assert_eq!(watched.wholes.load(Relaxed), 0, "the whole file was asked for");
    let (most, length) = (watched.most.load(Relaxed), LARGE.len());
    assert!(most <= 1 << 20 && 4 * most < length, "{most} of {length} bytes were asked for at once");
    assert_eq!(watched.read.load(Relaxed), length as u64);
    assert!(app.world().resource::<Assets<PlenOctree>>().get(&field).unwrap().leaves() > 400_000);
}

#[test]
fn sources_that_cannot_seek_are_loaded_too() {
    let watched = Watched::default();
    let mut app = app(&watched);
    let field = load(&app, 0);
    wait(&mut app, std::slice::from_ref(&field)).unwrap();
    assert_eq!(watched.wholes.load(Relaxed), 1);
    assert!(app.world().resource::<Assets<PlenOctree>>().get(&field).unwrap().leaves() > 400_000);
}

#[test]
fn errors_of_reading_name_the_file() {
    let watched = Watched { seekable: true, ends: Some(1 << 20), ..default() };
    let mut app = app(&watched);
    let field = load(&app, 7);
    let error = wait(&mut app, &[field]).unwrap_err();
    assert!(error.contains("watched://7.npz") && error.contains("the cable was pulled"), "{error}");
}

/// Returns the processor time that the threads of a pool have taken.
fn time_of(pool: &TaskPool) -> Duration {
    // A thread waits for the others, so that each has one of the tasks.
    let all = Arc::new(Barrier::new(pool.thread_num()));
    let time_of_thread = |all: Arc<Barrier>| async move {
        all.wait();
        ThreadTime::now().as_duration()
    };
    let times: Vec<_> = (0..pool.thread_num()).map(|_| pool.spawn(time_of_thread(all.clone()))).collect();
    times.into_iter().map(bevy::tasks::block_on).sum()
}

/// The pool reads files, but does not parse them, which takes twice as long.
#[test]
fn loading_keeps_no_other_task_waiting() {
    let watched = Watched { seekable: true, ..default() };
    let mut app = app(&watched);
    let file = io::Cursor::new(&*LARGE);
    let begin = ThreadTime::now();
    PlenOctree::read_from(file, "large.npz", &default()).unwrap();
    let parsing = begin.elapsed();
    let pool = IoTaskPool::get();
    let begin = time_of(pool);
    let fields: Vec<_> = (0..8).map(|index| load(&app, index)).collect();
    wait(&mut app, &fields).unwrap();
    let time = time_of(pool) - begin;
    assert!(time < 8 * parsing, "the pool took {time:?} for 8 files, of which parsing one takes {parsing:?}");
}

/// Tasks that do nothing run one after another during extraction. None may wait for a quarter of that time: as many
/// fields as the pool has threads would occupy all of them, if each of them occupied one.
#[test]
fn extraction_keeps_no_other_task_waiting() {
    let watched = Watched { seekable: true, ..default() };
    let mut app = app(&watched);
    let pool = AsyncComputeTaskPool::get();
    let fields: Vec<_> = (0..pool.thread_num()).map(|index| load(&app, index)).collect();
    wait(&mut app, &fields).unwrap();
    app.world_mut().resource_mut::<PaletteExtraction>().settings.sampling.sample_fraction = Some(0.25);
    for field in &fields {
        app.world_mut().spawn((Prop(field.clone()), Posterize::default()));
    }
    let begin = Instant::now();
    let mut longest = Duration::ZERO;
    let is_extracted = |app: &App, field| app.world().resource::<Palettes>().get(field).is_some();
    while !fields.iter().any(|field| is_extracted(&app, field)) {
        app.update();
        let extraction = app.world().resource::<PaletteExtraction>();
        assert!(fields.iter().all(|field| extraction.error(field).is_none()));
        let spawned = Instant::now();
        bevy::tasks::block_on(pool.spawn(async {}));
        longest = longest.max(spawned.elapsed());
        std::thread::sleep(Duration::from_millis(1));
    }
    let all = begin.elapsed();
    assert!(4 * longest < all, "a task waited for {longest:?} of {all:?}");
}
