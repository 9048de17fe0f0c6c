//! Apps whose assets are processed, in folders of their own.

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
use tempfile::TempDir;

use super::*;

/// A folder for the apps of a test, which is removed at the end.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("source")).unwrap();
        Self(folder)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.0.path().join("source").join(name), content).unwrap();
    }

    fn size(&self, name: &str) -> u64 {
        fs::metadata(self.0.path().join(name)).unwrap().len()
    }
}

/// What an app loads.
#[derive(Clone, Copy, PartialEq)]
enum Files {
    /// The files in `source`.
    Sources,
    /// The files in `processed`, which it makes of those.
    Processor,
    /// The files in `processed`, as a game that was shipped.
    Processed,
}

/// An app that loads from a folder in `folder`.
fn app(folder: &Path, files: Files) -> App {
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let mut app = App::new();
    app.add_plugins((
        TaskPoolPlugin::default(),
        AssetPlugin {
            mode: if files == Files::Sources { AssetMode::Unprocessed } else { AssetMode::Processed },
            file_path: path("source"),
            processed_file_path: path("processed"),
            use_asset_processor_override: Some(files == Files::Processor),
            watch_for_changes_override: Some(false),
            ..default()
        },
    ));
    if files == Files::Processor {
        let log = FileTransactionLogFactory { file_path: folder.join("log") };
        app.world().resource::<AssetProcessor>().data().set_log_factory(Box::new(log)).unwrap();
    }
    app.init_asset::<PlenOctree>().init_asset_loader::<PlenOctreeLoader>();
    register(&mut app);
    app.init_asset_loader::<CaptureLoader>();
    app.finish();
    app.cleanup();
    app
}

/// Loads fields. Those that fail are errors.
fn load<const N: usize>(app: &mut App, names: [&'static str; N]) -> [Result<PlenOctree, String>; N] {
    let server = app.world().resource::<AssetServer>().clone();
    app.update();
    let start = Instant::now();
    let handles: [Handle<PlenOctree>; N] = names.map(|name| server.load(name));
    handles.map(|handle| {
        let failed = loop {
            app.update();
            match server.get_load_state(&handle) {
                Some(LoadState::Loaded) => break None,
                Some(LoadState::Failed(error)) => break Some(error.to_string()),
                state => assert!(start.elapsed().as_secs() < 600, "{:?}: {state:?}", handle.path()),
            }
        };
        app.update();
        let field = app.world().resource::<Assets<PlenOctree>>().get(&handle);
        failed.map_or_else(|| Ok(field.unwrap().clone()), Err)
    })
}

/// A `.meta` that packs what `loader` loads, with these settings.
fn meta(loader: &str, loader_settings: &str, saver_settings: &str) -> String {
    format!(
        "(meta_format_version: \"1.0\", asset: Process(processor: \"LoadTransformAndSave<{loader}, \
         IdentityAssetTransformer<PlenOctree>, PackSaver>\", settings: (loader_settings: ({loader_settings}), \
         transformer_settings: (), saver_settings: ({saver_settings}))))"
    )
}

/// Settings of the source file end up in the packed one, and the app loads it under the same name.
#[test]
fn processed_apps_load_packed_fields() {
    let folder = Folder::new();
    let settings = BakeSettings { depth: 4, basis: Basis::Sh4, ..default() };
    let ball = bake(
        &settings,
        |at: DVec3| if at.length() < 0.8 { 90.0 } else { 0.0 },
        |at| move |from: DVec3| 0.5 + 0.3 * at + 0.3 * at * from,
    )
    .unwrap();
    ball.write(folder.0.path().join("source/ball.npz")).unwrap();
    folder.write("ball.npz.meta", meta("PlenOctreeLoader", "activation: Some(ShiftedRelu), up: Some(Y)", "rows: 32"));
    let [field] = load(&mut app(folder.0.path(), Files::Processor), ["ball.npz"]).map(Result::unwrap);
    assert_eq!((field.activation(), field.up()), (Activation::ShiftedRelu, UpAxis::Y));
    let last = field.codebook().unwrap().rows.iter().map(|[luma, _]| *luma).max();
    assert!(last.is_some_and(|row| (1..32).contains(&row)), "{last:?}");
    assert!(folder.size("processed/ball.npz") < folder.size("source/ball.npz"));
}

/// The Gaussians of three bars that cross in the origin, from -1 to 1, and of a floater beyond the end of one. x is to
/// the right, -y is up.
fn gaussians() -> Vec<Vec3> {
    let steps = || (-12..=12).map(|step| step as f32 / 12.0);
    let bars = Vec3::AXES.into_iter().flat_map(|axis| steps().map(move |step| step * axis));
    bars.chain([Vec3::new(1.3, 0.3, 0.3)]).collect()
}

/// The same Gaussians as an ASCII `.ply` file.
fn ply() -> String {
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let all = gaussians();
    let row = |at: &Vec3| format!("{} {} {} 1.4 -1.4 -1.4 3 -3 -3 -3 1 0 0 0\n", at.x, at.y, at.z);
    let rows: String = all.iter().map(row).collect();
    format!("ply\nformat ascii 1.0\nelement vertex {}\n{properties}end_header\n{rows}", all.len())
}

/// The same as a `.splat` file. x is to the right and -y is up.
fn splat() -> Vec<u8> {
    let scale = [(-3.0f32).exp(); 3];
    // A color, an opacity, and a rotation.
    let rest = [230, 26, 26, 243, 255, 128, 128, 128];
    let row = |at: &Vec3| at.to_array().into_iter().chain(scale).flat_map(f32::to_le_bytes).chain(rest);
    gaussians().iter().flat_map(row).collect()
}

/// The same as a glTF document whose numbers are in a file next to it, and that file. x is to the left and y is up.
fn gltf() -> (String, Vec<u8>) {
    let all = gaussians();
    let (scale, opacity) = ((-3.0f32).exp(), 1.0 / (1.0 + (-3.0f32).exp()));
    let columns: [(&str, &str, Vec<Vec<f32>>); 5] = [
        ("POSITION", "VEC3", all.iter().map(|at| vec![-at.x, -at.y, at.z]).collect()),
        ("KHR_gaussian_splatting:ROTATION", "VEC4", all.iter().map(|_| vec![0.0, 0.0, 0.0, 1.0]).collect()),
        ("KHR_gaussian_splatting:SCALE", "VEC3", all.iter().map(|_| vec![scale; 3]).collect()),
        ("KHR_gaussian_splatting:OPACITY", "SCALAR", all.iter().map(|_| vec![opacity]).collect()),
        ("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", all.iter().map(|_| vec![1.4, -1.4, -1.4]).collect()),
    ];
    let (mut buffer, mut views, mut accessors) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    let mut attributes = serde_json::Map::new();
    for (index, (name, kind, rows)) in columns.into_iter().enumerate() {
        let start = buffer.len();
        buffer.extend(rows.concat().iter().flat_map(|number| number.to_le_bytes()));
        let length = buffer.len() - start;
        views.push(serde_json::json!({"buffer": 0, "byteOffset": start, "byteLength": length}));
        let accessor =
            serde_json::json!({"bufferView": index, "componentType": 5126, "count": all.len(), "type": kind});
        accessors.push(accessor);
        attributes.insert(name.into(), index.into());
    }
    let extension = serde_json::json!({"kernel": "ellipse", "colorSpace": "srgb_rec709_display"});
    let document = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{
            "attributes": attributes, "mode": 0, "extensions": {"KHR_gaussian_splatting": extension}
        }]}],
        "buffers": [{"byteLength": buffer.len(), "uri": "numbers.bin"}],
        "bufferViews": views, "accessors": accessors,
    });
    (document.to_string(), buffer)
}

/// A capture becomes a packed field that stands on the origin, cropped and without floaters if its `.meta` file says
/// so. So does a glTF file whose `.meta` file says that it is a capture, with another file next to it, which the
/// processor ignores. Damaged captures fail. A shipped game needs only what was processed.
#[test]
fn processed_apps_load_packed_captures() {
    let folder = Folder::new();
    let (document, numbers) = gltf();
    for (name, content) in [
        ("cross.ply", ply().into_bytes()),
        ("cropped.ply", ply().into_bytes()),
        ("plain.splat", splat()),
        ("cross.gltf", document.clone().into_bytes()),
        ("alone.gltf", document.replace("numbers.bin", "missing.bin").into_bytes()),
        ("damaged.ply", ply().into_bytes()[..900].to_vec()),
        ("damaged.splat", splat()[..90].to_vec()),
        ("numbers.bin", numbers),
    ] {
        folder.write(name, content);
    }
    let capture = |settings: &str| meta("CaptureLoader", settings, "rows: 32");
    folder.write("cross.ply.meta", capture("depth: 6, keep_largest: true"));
    folder.write("cross.gltf.meta", capture("depth: 6"));
    folder.write("alone.gltf.meta", capture("depth: 6"));
    // The example in the guide.
    let documented =
        include_str!("../../../docs/guide/load.md").split("```").find_map(|block| block.strip_prefix("ron\n"));
    folder.write("cropped.ply.meta", documented.unwrap().replace("depth: 8", "depth: 6"));
    let names = ["cross.ply", "cross.gltf", "cropped.ply", "plain.splat"];
    let damaged = ["alone.gltf", "damaged.ply", "damaged.splat"];
    let mut processor = app(folder.0.path(), Files::Processor);
    let fields = load(&mut processor, names).map(Result::unwrap);
    // The processor logs what is wrong. The app finds nothing processed.
    assert!(load(&mut processor, damaged).iter().all(Result::is_err));
    let [cross, gltf, cropped, plain] = fields.each_ref().map(|field| field.bounds().unwrap());
    let size = |(low, high): (DVec3, DVec3)| high - low;
    assert!(cross.0.z.abs() < 0.1 && size(cross).cmpgt(DVec3::splat(2.0)).all(), "{cross:?}");
    assert!(size(cross).cmplt(DVec3::splat(2.35)).all() && size(gltf).x > 2.4, "{cross:?} {gltf:?}");
    assert!(gltf.0.z.abs() < 0.1 && (1.4..1.8).contains(&size(cropped).z), "{gltf:?} {cropped:?}");
    // Without a `.meta` file, there are the default settings.
    assert!(fields[3].depth() == 8 && plain.0.z.abs() < 0.1 && size(plain).x > 2.4, "{plain:?}");

    fs::remove_dir_all(folder.0.path().join("source")).unwrap();
    let all =
        |field: &PlenOctree| (field.nodes().to_vec(), field.densities().to_vec(), field.coefficients().into_owned());
    let shipped = load(&mut app(folder.0.path(), Files::Processed), names).map(Result::unwrap);
    for ((name, shipped), field) in names.into_iter().zip(shipped).zip(fields) {
        assert!(fs::read(folder.0.path().join("processed").join(name)).unwrap().starts_with(b"\x89PLO"), "{name}");
        assert!(shipped.codebook().is_some() && all(&shipped) == all(&field), "{name}");
    }
}

/// Apps without the asset processor load captures as they are, and say why others fail.
#[test]
fn apps_load_captures() {
    let folder = Folder::new();
    let (document, numbers) = gltf();
    folder.write("cross.ply", ply());
    folder.write("cross.gltf", &document);
    folder.write("alone.gltf", document.replace("numbers.bin", "missing.bin"));
    folder.write("numbers.bin", numbers);
    let meta = "(meta_format_version: \"1.0\", asset: Load(loader: \"bevy_plenoctree::CaptureLoader\", \
                settings: (depth: 6, keep_largest: true)))";
    for name in ["cross.ply.meta", "cross.gltf.meta", "alone.gltf.meta"] {
        folder.write(name, meta);
    }
    let names = ["cross.ply", "cross.gltf", "alone.gltf"];
    let [cross, gltf, alone] = load(&mut app(folder.0.path(), Files::Sources), names);
    let (cross, gltf) = (cross.unwrap(), gltf.unwrap());
    assert!(cross.codebook().is_none() && cross.bounds().unwrap().0.z.abs() < 0.1);
    assert!((gltf.leaves() as f64 / cross.leaves() as f64 - 1.0).abs() < 0.01);
    let error = alone.unwrap_err();
    assert!(error.contains("alone.gltf") && error.contains("missing.bin"), "{error}");
}
