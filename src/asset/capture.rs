//! Captures as assets.

use std::{
    collections::HashMap,
    io,
    path::Path,
    sync::{Arc, Weak},
};

use bevy::{
    asset::{AssetLoader, AssetPath, AssetServerMode, LoadContext, io::Reader},
    prelude::*,
    reflect::TypePath,
};
use plenoctree::PlenOctree;
use plenoctree_fit::splat::{
    Axis, SplatError, SplatSettings, Splats, SpzAxes, Subject, SubjectSettings, VoxelSettings, voxelize,
};
use serde::{Deserialize, Serialize};

use super::{progress::FilesRead, turn::turn};
use crate::background::{self, on_cores};

/// The extensions of captures that need no `.meta` file.
pub(super) const EXTENSIONS: [&str; 4] = ["ply", "spz", "sog", "splat"];

/// Loads captures of Gaussian splats as [`PlenOctree`] assets: `.ply`, `.spz`, `.sog` and `.splat` files, and others
/// whose `.meta` file names this loader, such as glTF with `KHR_gaussian_splatting`, or the `meta.json` file of SOG.
///
/// The Gaussians are added up in the cells of a field in the background, for at most two captures at a time. This takes
/// seconds, and fields of captures are large, so pack them with the asset processor
/// ([`PackSaver`](crate::PackSaver)), or convert them with `plenoctree convert`, which also refines them. Invalid files
/// fail to load with a [`SplatError`].
#[derive(TypePath)]
#[type_path = "bevy_plenoctree"]
pub struct CaptureLoader {
    files: FilesRead,
    // The server owns its loaders.
    server: Weak<AssetServer>,
}

/// Keeps the asset server available to [`CaptureLoader`] as long as the app exists.
#[derive(Resource)]
struct CaptureServer {
    _server: Arc<AssetServer>,
}

impl FromWorld for CaptureLoader {
    fn from_world(world: &mut World) -> Self {
        let files = world.get_resource_or_init::<FilesRead>().clone();
        let server = Arc::new(world.resource::<AssetServer>().clone());
        let loader = Self { files, server: Arc::downgrade(&server) };
        world.insert_resource(CaptureServer { _server: server });
        loader
    }
}

/// Settings of [`CaptureLoader`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CaptureSettings {
    /// Number of levels of cells, 6 to 10: the finest are `2^-depth` of the field's cube wide. 8 by default. The field
    /// looks like the capture from where a finest cell is about as wide as a pixel.
    pub depth: u32,
    /// The largest number of leaves of any size, 32768 to 20,000,000, which are small where the capture shows detail.
    /// 3,000,000 by default.
    pub leaves: u32,
    /// Lowest and highest corner of the box to convert, in the coordinates of the capture. By default, it contains most
    /// Gaussians.
    pub crop: Option<[[f64; 3]; 2]>,
    /// Keep only the largest connected part, without floaters and backgrounds. Off by default.
    pub keep_largest: bool,
    /// The direction that is up in the capture: the field is turned upright, and placed on the origin.
    /// [`Axis::NegativeY`] by default, with a warning if the file says otherwise. With `None`, the field keeps the
    /// coordinates of the capture.
    pub stand: Option<Axis>,
    /// The axes of an SPZ file that does not record them. [`SpzAxes::Unknown`], the default, reads it as
    /// [`SpzAxes::RightUpBack`] and logs a warning. Files of splat-transform 3, SuperSplat and Niantic's `ply_to_spz`
    /// then come out upside down: they need [`SpzAxes::RightDownFront`].
    pub spz_axes: SpzAxes,
}

impl Default for CaptureSettings {
    fn default() -> Self {
        Self {
            depth: 8,
            leaves: 3_000_000,
            crop: None,
            keep_largest: false,
            stand: Some(Axis::default()),
            spz_axes: SpzAxes::default(),
        }
    }
}

impl CaptureSettings {
    /// Converts a capture to a field.
    fn field(&self, splats: Splats) -> Result<PlenOctree, SplatError> {
        let crop = self.crop.map(|[low, high]| (low.into(), high.into()));
        let settings = SubjectSettings { crop, keep_largest: self.keep_largest, up: self.stand };
        let Subject { splats, low, high, .. } = splats.subject(&settings)?;
        let bounds = Some((low, high));
        let settings =
            VoxelSettings { depth: self.depth, leaves: self.leaves as usize, bounds, ..VoxelSettings::default() };
        let field = voxelize(&splats, &settings)?;
        let shift = field.foot().filter(|_| self.stand.is_some()).unwrap_or_default();
        Ok(field.shifted(-shift)?)
    }
}

/// The files next to a capture that have been read, or why they could not be.
type Beside = HashMap<String, Result<Vec<u8>, String>>;

impl AssetLoader for CaptureLoader {
    type Asset = PlenOctree;
    type Settings = CaptureSettings;
    type Error = SplatError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        settings: &CaptureSettings,
        context: &mut LoadContext<'_>,
    ) -> Result<PlenOctree, SplatError> {
        let path = context.path().clone();
        let file = path.to_string();
        let mut progress = self.files.watch(path.clone());
        // Also before the file is read, which may take much memory.
        let _turn = turn().await;
        let bytes = progress.read(reader).await.map_err(|source| SplatError::Io { file: file.clone(), source })?;
        let (bytes, mut beside) = (Arc::new(bytes), Beside::new());
        loop {
            // Only parsing shows which files there are next to it, and only this task can read them.
            let (bytes, file, settings) = (bytes.clone(), file.clone(), settings.clone());
            let work = move || (on_cores(|| convert(&bytes, &file, &settings, &beside)), beside);
            let (result, known) = background::spawn(work).await;
            match result {
                Ok(result) => return result,
                Err(Unread(name)) => {
                    beside = known;
                    let content = self.read_beside(context, &path, &name).await;
                    beside.insert(name, content);
                }
            }
        }
    }

    fn extensions(&self) -> &[&str] {
        &EXTENSIONS
    }
}

impl CaptureLoader {
    /// Reads a file next to a capture.
    async fn read_beside(
        &self,
        context: &mut LoadContext<'_>,
        capture: &AssetPath<'static>,
        name: &str,
    ) -> Result<Vec<u8>, String> {
        let folder = capture.path().parent().unwrap_or(Path::new(""));
        let path = AssetPath::from_path_buf(folder.join(name)).with_source(capture.source().clone_owned());
        let server = self.server.upgrade().ok_or("the app has exited")?;
        if server.mode() == AssetServerMode::Unprocessed {
            return context.read_asset_bytes(path).await.map_err(|error| error.to_string());
        }
        // The asset processor ignores files that have no loader, such as these. `read_asset_bytes` would wait for them
        // to be processed, forever.
        let source = server.get_source(path.source()).map_err(|error| error.to_string())?;
        let mut reader = source.reader().read(path.path()).await.map_err(|error| error.to_string())?;
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|error| error.to_string())?;
        Ok(bytes)
    }
}

/// The name of a file next to a capture that has to be read first.
struct Unread(String);

/// Parses a capture and converts it to a field.
fn convert(
    bytes: &[u8],
    file: &str,
    settings: &CaptureSettings,
    known: &Beside,
) -> Result<Result<PlenOctree, SplatError>, Unread> {
    let mut unread = None;
    let mut beside = |name: &str| match known.get(name) {
        Some(content) => content.clone().map_err(io::Error::other),
        None => {
            unread.get_or_insert_with(|| name.to_owned());
            Err(io::ErrorKind::NotFound.into())
        }
    };
    let splats = Splats::from_bytes(bytes, file, &SplatSettings { spz_axes: settings.spz_axes }, &mut beside);
    if let Some(name) = unread {
        return Err(Unread(name));
    }
    Ok(splats.and_then(|splats| {
        if splats.assumes_axes() {
            warn!(
                "{file} does not record its axes; if it is upside down, as files of splat-transform 3, SuperSplat and \
                 Niantic's ply_to_spz are, load it with `spz_axes: RightDownFront` (`RightUpBack` silences this)"
            );
        }
        if let Some(up) = splats.up().filter(|up| settings.stand == Some(Axis::default()) && *up != Axis::default()) {
            warn!("{file} says that {up} is up; load it with `stand: Some({up:?})`, or it does not stand upright");
        }
        settings.field(splats)
    }))
}
