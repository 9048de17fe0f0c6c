//! Loads fields from files on a thread, shows them once they are complete, and reloads them when their files change.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::SystemTime,
};

use bevy::{prelude::*, render::renderer::RenderDevice};
use bevy_plenoctree::{
    FieldPalette, FieldTooLarge, GpuField, LoadSettings, Palette, PaletteOverride, Palettes, PlenOctree, Posterize,
    Prop,
};
use plenoctree::{ReadError, palette::PaletteFileError};

use crate::{
    action::Action,
    extent::{Extent, visible_extent},
    notices::Notices,
    palette_file::palette_beside,
};

#[derive(Resource)]
pub struct Loader {
    settings: LoadSettings,
    /// The file and the palette that the command line names, if it names a palette. Until that file is shown.
    chosen: Option<(PathBuf, Palette)>,
    reading: Option<Reading>,
    shown: Option<Shown>,
}

/// A file that is being read.
struct Reading {
    path: PathBuf,
    version: Option<Version>,
    read: Arc<AtomicU64>,
    thread: JoinHandle<Result<Arrival, ReadError>>,
}

/// The file whose field is shown.
struct Shown {
    path: PathBuf,
    extent: Extent,
    /// The version that was last read.
    version: Option<Version>,
    /// The version that the watcher last saw.
    seen: Option<Version>,
}

/// The result of reading a file.
struct Arrival {
    field: PlenOctree,
    extent: Option<Extent>,
    /// The palette from the file next to the field, if that file exists.
    palette: Option<Result<Palette, PaletteFileError>>,
}

/// The time at which a file was last written, and its length in bytes.
type Version = (SystemTime, u64);

impl Loader {
    pub fn new(settings: LoadSettings, chosen: Option<(PathBuf, Palette)>) -> Self {
        Self { settings, chosen, reading: None, shown: None }
    }

    /// Returns the file that is being read, and the progress from 0 to 1.
    pub fn reading(&self) -> Option<(&Path, f32)> {
        let reading = self.reading.as_ref()?;
        let length = reading.version.map_or(1, |(_, length)| length.max(1));
        Some((&reading.path, (reading.read.load(Ordering::Relaxed) as f32 / length as f32).min(1.0)))
    }

    /// Returns the file whose field is shown.
    pub fn shown(&self) -> Option<&Path> {
        self.shown.as_ref().map(|shown| shown.path.as_path())
    }

    /// Returns the visible extent of the shown field.
    pub fn extent(&self) -> Option<Extent> {
        self.shown.as_ref().map(|shown| shown.extent)
    }

    fn start(&mut self, path: PathBuf) {
        // Before reading: if the file changes meanwhile, it is read again.
        let version = version(&path);
        let read = Arc::new(AtomicU64::new(0));
        let (settings, counter, file) = (self.settings.clone(), read.clone(), path.clone());
        // Not in Bevy's task pools, which this would block.
        let thread = thread::spawn(move || {
            let field = read_counted(&file, counter, &settings)?;
            let extent = visible_extent(&field);
            let beside = palette_beside(&file);
            let palette = beside.exists().then(|| Palette::read(beside));
            Ok(Arrival { field, extent, palette })
        });
        self.reading = Some(Reading { path, version, read, thread });
    }
}

/// Starts reading the file that the user opened last.
pub fn open(mut actions: MessageReader<Action>, mut loader: ResMut<Loader>) {
    for action in actions.read() {
        if let Action::Open(path) = action {
            loader.start(path.clone());
        }
    }
}

/// Checks once a second whether the file has changed and is no longer being written.
pub fn watch(mut loader: ResMut<Loader>, time: Res<Time<Real>>, mut last: Local<f32>) {
    if time.elapsed_secs() - *last < 1.0 || loader.reading.is_some() {
        return;
    }
    *last = time.elapsed_secs();
    let Some(shown) = &mut loader.shown else {
        return;
    };
    let now = version(&shown.path);
    let settled = std::mem::replace(&mut shown.seen, now) == now;
    if settled && now.is_some() && now != shown.version {
        let path = shown.path.clone();
        loader.start(path);
    }
}

/// Shows a field once it is read. If that fails, the previous field stays.
pub fn arrive(
    mut commands: Commands,
    mut loader: ResMut<Loader>,
    mut fields: ResMut<Assets<PlenOctree>>,
    mut palettes: ResMut<Palettes>,
    mut notices: ResMut<Notices>,
    device: Option<Res<RenderDevice>>,
    props: Query<(Entity, &Prop)>,
) {
    let Some(reading) = loader.reading.take_if(|reading| reading.thread.is_finished()) else {
        return;
    };
    let Reading { path, version, thread, .. } = reading;
    let result = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let again = loader.shown.as_mut().filter(|shown| shown.path == path);
    // Do not read a broken file again until it changes.
    let before = again.map(|shown| std::mem::replace(&mut shown.version, version));
    let Arrival { field, extent, palette } = match result {
        Ok(arrival) => arrival,
        Err(error) => return notices.error(error.to_string()),
    };
    let Some(extent) = extent else {
        return notices.error(format!("{}: nothing is visible in the field", path.display()));
    };
    if let Err(error) = check(&field, device.as_deref()) {
        return notices.error(format!("{}: {error}", path.display()));
    }
    notices.forget_errors();
    if before == Some(version) {
        return notices.info(format!("{} has not changed", path.display()));
    }
    let prop = props.iter().next();
    if let (Some((_, prop)), Some(shown)) = (prop, loader.shown.as_mut().filter(|_| before.is_some())) {
        match fields.insert(&prop.0, field) {
            Ok(()) => {
                shown.extent = extent;
                notices.info(format!("Reloaded {}, which has changed", path.display()));
            }
            Err(error) => notices.error(error.to_string()),
        }
        return;
    }
    let field = fields.add(field);
    let chosen = loader.chosen.take_if(|(file, _)| *file == path);
    match chosen.map(|(_, palette)| Ok(palette)).or(palette) {
        Some(Ok(palette)) => palettes.insert(&field, FieldPalette::new(palette)),
        Some(Err(error)) => notices.error(error.to_string()),
        None => {}
    }
    match prop {
        Some((entity, _)) => {
            // The former field's colors are not those of this one.
            commands.entity(entity).insert(Prop(field)).remove::<PaletteOverride>();
        }
        None => {
            commands.spawn((Prop(field), Posterize::default()));
        }
    }
    loader.shown = Some(Shown { path, extent, version, seen: version });
}

/// Checks that the GPU can hold the field.
fn check(field: &PlenOctree, device: Option<&RenderDevice>) -> Result<(), FieldTooLarge> {
    device.map_or(Ok(()), |device| GpuField::check(field, &device.limits()))
}

fn version(path: &Path) -> Option<Version> {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

fn read_counted(path: &Path, read: Arc<AtomicU64>, settings: &LoadSettings) -> Result<PlenOctree, ReadError> {
    let label = path.display().to_string();
    match File::open(path) {
        Ok(file) => PlenOctree::read_from(BufReader::new(Counted { file, read }), &label, settings),
        Err(error) => Err(ReadError { file: label, fault: error.into() }),
    }
}

/// A file that counts the bytes read from it.
struct Counted {
    file: File,
    read: Arc<AtomicU64>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.file.read(buffer)?;
        self.read.fetch_add(bytes as u64, Ordering::Relaxed);
        Ok(bytes)
    }
}

impl Seek for Counted {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
