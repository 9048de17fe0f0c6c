//! Packs fields in the asset processor.

use std::sync::Arc;

use bevy::{
    asset::{
        AssetPath, AsyncWriteExt,
        io::Writer,
        processor::LoadTransformAndSave,
        saver::{AssetSaver, SavedAsset},
        transformer::IdentityAssetTransformer,
    },
    prelude::*,
    reflect::TypePath,
};
use plenoctree::{LoadSettings, PackSettings, Packed, PlenOctree, sampling::Progress};

use super::loader::PlenOctreeLoader;
use crate::background::{self, on_cores};

/// Packs the fields of an app whose [`AssetMode`] is [`Processed`](AssetMode::Processed), so that the game ships small
/// files without a manual step. [`PlenOctreePlugin`](crate::PlenOctreePlugin) makes it the default for `.npz` files if
/// the feature `pack` is enabled.
///
/// A file's `.meta` file can set its [`PackSettings`]. Loading is unchanged: the paths of the `.npz` file and of the
/// palette next to it stay the same.
#[derive(Default, TypePath)]
pub struct PackSaver;

impl AssetSaver for PackSaver {
    type Asset = PlenOctree;
    type Settings = PackSettings;
    type OutputLoader = PlenOctreeLoader;
    type Error = BevyError;

    async fn save(
        &self,
        writer: &mut Writer,
        asset: SavedAsset<'_, '_, PlenOctree>,
        settings: &PackSettings,
        _path: AssetPath<'_>,
    ) -> Result<LoadSettings, BevyError> {
        let (field, settings) = (asset.get().clone(), settings.clone());
        // If the app exits, the task is dropped, which cancels the work.
        let progress = Arc::new(Progress::default());
        let guard = CancelOnDrop(progress.clone());
        let pack = move || on_cores(|| Packed::new(&field, &settings, &progress));
        let packed = background::spawn(pack).await?;
        drop(guard);
        writer.write_all(packed.bytes()).await?;
        // The file now records what the source's settings said: its activation, its up axis and the leaves to keep.
        Ok(LoadSettings { density_threshold: 0.0, ..default() })
    }
}

struct CancelOnDrop(Arc<Progress>);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// Loads a field and saves it packed.
type PackProcessor = LoadTransformAndSave<PlenOctreeLoader, IdentityAssetTransformer<PlenOctree>, PackSaver>;

/// Registers the processor for fields that are not packed.
pub(crate) fn register(app: &mut App) {
    app.register_asset_processor(PackProcessor::from(PackSaver)).set_default_asset_processor::<PackProcessor>("npz");
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path, time::Instant};

    use bevy::{
        app::TaskPoolPlugin,
        asset::{
            LoadState,
            processor::{AssetProcessor, FileTransactionLogFactory},
        },
    };
    use glam::DVec3;
    use plenoctree::{Activation, BakeSettings, Basis, UpAxis, bake};

    use super::*;

    /// A folder that is removed at the end.
    struct Folder(std::path::PathBuf);

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    /// An app whose assets are processed from `source` to `processed`, in `folder`.
    fn app(folder: &Path) -> App {
        let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        let mut app = App::new();
        app.add_plugins((
            TaskPoolPlugin::default(),
            AssetPlugin {
                mode: AssetMode::Processed,
                file_path: path("source"),
                processed_file_path: path("processed"),
                use_asset_processor_override: Some(true),
                watch_for_changes_override: Some(false),
                ..default()
            },
        ));
        let log = FileTransactionLogFactory { file_path: folder.join("log") };
        app.world().resource::<AssetProcessor>().data().set_log_factory(Box::new(log)).unwrap();
        app.init_asset::<PlenOctree>().init_asset_loader::<PlenOctreeLoader>();
        register(&mut app);
        app
    }

    /// Settings of the source file end up in the packed one, and the app loads it under the same name.
    #[test]
    fn processed_apps_load_packed_fields() {
        let folder = Folder(std::env::temp_dir().join(format!("bevy_plenoctree-pack-{}", std::process::id())));
        let _ = fs::remove_dir_all(&folder.0);
        fs::create_dir_all(folder.0.join("source")).unwrap();
        let settings = BakeSettings { depth: 4, basis: Basis::Sh4, ..default() };
        let ball = bake(
            &settings,
            |at: DVec3| if at.length() < 0.8 { 90.0 } else { 0.0 },
            |at| move |from: DVec3| 0.5 + 0.3 * at + 0.3 * at * from,
        )
        .unwrap();
        ball.write(folder.0.join("source/ball.npz")).unwrap();
        let meta = "(meta_format_version: \"1.0\", asset: Process(processor: \"LoadTransformAndSave<PlenOctreeLoader, \
                    IdentityAssetTransformer<PlenOctree>, PackSaver>\", settings: (loader_settings: (activation: \
                    Some(ShiftedRelu), up: Some(Y)), transformer_settings: (), saver_settings: (rows: 32))))";
        fs::write(folder.0.join("source/ball.npz.meta"), meta).unwrap();

        let mut app = app(&folder.0);
        app.finish();
        app.cleanup();
        let server = app.world().resource::<AssetServer>().clone();
        app.update();
        let handle: Handle<PlenOctree> = server.load("ball.npz");
        let start = Instant::now();
        while !matches!(server.get_load_state(&handle), Some(LoadState::Loaded | LoadState::Failed(_))) {
            app.update();
            assert!(start.elapsed().as_secs() < 60, "{:?}", server.get_load_state(&handle));
        }
        app.update();
        let assets = app.world().resource::<Assets<PlenOctree>>();
        let field = assets.get(&handle).unwrap_or_else(|| panic!("{:?}", server.get_load_state(&handle)));
        assert_eq!((field.activation(), field.up()), (Activation::ShiftedRelu, UpAxis::Y));
        let last = field.codebook().unwrap().rows.iter().map(|[luma, _]| *luma).max();
        assert!(last.is_some_and(|row| (1..32).contains(&row)), "{last:?}");
        let size = |name: &str| fs::metadata(folder.0.join(name)).unwrap().len();
        assert!(size("processed/ball.npz") < size("source/ball.npz"));
    }
}
