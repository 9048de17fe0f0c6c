//! Pictures of a glTF model: the engine renders it, lit, from cameras around it.

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use bevy::{
    asset::{LoadState, RecursiveDependencyLoadState},
    camera::primitives::Aabb,
    gltf::{GltfAssetLabel, GltfLoaderSettings, GltfPlugin},
    light::{CascadeShadowConfigBuilder, EnvironmentMapLight},
    math::Vec3A,
    pbr::PbrPlugin,
    prelude::*,
    world_serialization::WorldSerializationPlugin,
};
use bevy_plenoctree::{
    PlenOctreePlugin, UpAxis,
    headless::{Headless, LitMeshPlugins, exact_camera, pinhole_view},
};
use glam::DVec3;
use image::{Rgba, RgbaImage};
use plenoctree::camera::{PinholeCamera, Spiral};

use crate::{files, fit::mipmaps, progress, result::Result, transforms};

/// The horizontal field of view of the cameras, in radians.
const FOV: f64 = 0.7;
/// Pixels that are rendered per pixel of the input, along each axis. The fit averages them.
pub const SUPERSAMPLING: u32 = 2;
/// The time limit for loading a model.
const LOAD_TIMEOUT: Duration = Duration::from_secs(300);

/// Renders the model from `views` cameras all around it, [`SUPERSAMPLING`] times as large as `size`, with its opacity.
/// Writes the pictures to `folder`, with a `transforms.json` file whose path is returned.
///
/// The frame of the cameras has z up, as fields have by default: a prop with the identity transform is where the model
/// is.
pub fn photograph(model: &Path, folder: &Path, views: u32, size: u32) -> Result<PathBuf> {
    let parent = files::folder_of(model).canonicalize().map_err(|error| format!("{}: {error}", model.display()))?;
    let name = model.file_name().ok_or_else(|| format!("{}: not the name of a file", model.display()))?;
    let side = SUPERSAMPLING * size;
    let mut studio = Headless::with_assets(UVec2::splat(side), &parent, |app| {
        app.add_plugins((WorldSerializationPlugin, GltfPlugin::default(), LitMeshPlugins.set(PbrPlugin::default())));
        app.add_plugins(PlenOctreePlugin);
        app.add_systems(Update, mipmaps::add_to_textures.run_if(resource_changed::<Assets<Image>>));
        // The components of the scene are copied by reflection.
        app.world().resource::<AppTypeRegistry>().write().register_derived_types();
    })?;
    let root = load(&mut studio, model, name)?;
    let (low, high) = bounds(studio.app.world_mut())
        .ok_or_else(|| format!("{}: found no mesh in its first scene", model.display()))?;
    let (center, radius) = (0.5 * (low + high), (0.5 * (high - low).length()).max(1e-6));
    // Models of any size are rendered as if they were in the unit ball, which the near plane and shadows are made for.
    let to_unit = |point: DVec3| (point - center) / radius;
    let to_unit_ball = Transform::from_translation((UpAxis::Z.to_y_up() * to_unit(DVec3::ZERO)).as_vec3())
        .with_scale(Vec3::splat((1.0 / radius) as f32));
    studio.app.world_mut().entity_mut(root).insert(to_unit_ball);
    light(studio.app.world_mut());

    files::create_folder(folder)?;
    // Pictures of an earlier model would be taken for those of this one if the rest is never rendered.
    let _ = fs::remove_file(folder.join(transforms::FILE));
    let target = studio.target();
    let environment = environment(&mut studio.app.world_mut().resource_mut::<Assets<Image>>());
    let camera = studio.app.world_mut().spawn((exact_camera(Color::NONE), target, environment)).id();
    let bar = progress::bar("rendering", views.into(), false);
    let mut pictures = Vec::new();
    let spiral = Spiral { center, radius, up: UpAxis::Z, fov: FOV, elevations: [1.0, -1.0], distances: &[] };
    for (view, pinhole) in spiral.cameras(views, side).enumerate() {
        let in_unit_ball = PinholeCamera { position: to_unit(pinhole.position), ..pinhole };
        studio.app.world_mut().entity_mut(camera).insert(pinhole_view(&in_unit_ball, UpAxis::Z));
        if view == 0 {
            studio.wait_until_ready(LOAD_TIMEOUT)?;
        }
        let name = format!("view_{view:03}.png");
        files::write_image(&folder.join(&name), &straight(studio.capture()?))?;
        pictures.push((name, pinhole));
        bar.inc(1);
    }
    bar.finish_and_clear();
    transforms::write(folder, FOV, &pictures)
}

/// Spawns the model's first scene, without its own cameras and lights, and waits until all of it is loaded. Returns its
/// root.
fn load(studio: &mut Headless, model: &Path, name: &OsStr) -> Result<Entity> {
    let server = studio.app.world().resource::<AssetServer>();
    let scene: Handle<WorldAsset> = server
        .load_builder()
        .with_settings(|settings: &mut GltfLoaderSettings| {
            settings.load_cameras = false;
            settings.load_lights = false;
        })
        .load(GltfAssetLabel::Scene(0).from_asset(PathBuf::from(name)));
    let root = studio.app.world_mut().spawn(WorldAssetRoot(scene.clone())).id();
    // Behind the first line, there may be a backtrace of the loader.
    let failed = |error: String| format!("{}: {}", model.display(), error.lines().next().unwrap_or_default());
    let start = Instant::now();
    loop {
        studio.update();
        let server = studio.app.world().resource::<AssetServer>();
        match server.get_load_states(&scene) {
            Some((LoadState::Failed(error), ..)) => return Err(failed(error.to_string()).into()),
            Some((.., RecursiveDependencyLoadState::Failed(error))) => return Err(failed(error.to_string()).into()),
            Some((.., RecursiveDependencyLoadState::Loaded)) => break,
            _ if start.elapsed() > LOAD_TIMEOUT => {
                return Err(format!("{}: not loaded after {LOAD_TIMEOUT:?}", model.display()).into());
            }
            _ => std::thread::sleep(Duration::from_millis(5)),
        }
    }
    // The scene is spawned in the next frame, and its bounds are known in the one after that.
    (0..3).for_each(|_| studio.update());
    Ok(root)
}

/// Returns the box around all meshes, in the frame of the cameras.
fn bounds(world: &mut World) -> Option<(DVec3, DVec3)> {
    let mut meshes = world.query::<(&Aabb, &GlobalTransform)>();
    let corners = meshes.iter(world).flat_map(|(aabb, transform)| {
        let corner = |bits: u32| {
            let sign = Vec3A::new((bits & 1) as f32, (bits >> 1 & 1) as f32, (bits >> 2) as f32) * 2.0 - 1.0;
            let point = transform.affine().transform_point3a(aabb.center + sign * aabb.half_extents);
            UpAxis::Z.to_y_up().transpose() * point.as_dvec3()
        };
        (0..8).map(corner).collect::<Vec<_>>()
    });
    let finite = corners.filter(|corner| corner.is_finite());
    finite.map(|corner| (corner, corner)).reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
}

/// Adds a key light from the upper left, which casts shadows, and a weaker one from the right. With the environment, a
/// white surface that faces the key light is just not overexposed. Shadows reach just around the unit ball, so that
/// they look alike from all cameras.
fn light(world: &mut World) {
    let distance = 1.0 / (0.5 * FOV).sin() as f32;
    let shadows = CascadeShadowConfigBuilder {
        num_cascades: 1,
        minimum_distance: distance - 1.1,
        maximum_distance: distance + 1.1,
        ..default()
    };
    for (from, illuminance, shadow_maps_enabled) in
        [(Vec3::new(-1.0, 2.0, 1.5), 2000.0, true), (Vec3::new(2.0, 0.5, 1.0), 500.0, false)]
    {
        let light = DirectionalLight { illuminance, shadow_maps_enabled, ..default() };
        world.spawn((light, shadows.build(), Transform::from_translation(from).looking_at(Vec3::ZERO, Vec3::Y)));
    }
}

/// Returns a bright sky over a darker ground, which metals reflect.
fn environment(images: &mut Assets<Image>) -> EnvironmentMapLight {
    let [sky, horizon, ground] = [[0.8, 0.9, 1.0], [0.6, 0.6, 0.6], [0.25, 0.22, 0.2]].map(Color::srgb_from_array);
    EnvironmentMapLight {
        intensity: 500.0,
        ..EnvironmentMapLight::hemispherical_gradient(images, sky, horizon, ground)
    }
}

/// Converts a frame over a transparent background, whose light is multiplied by opacity, to straight colors.
fn straight(frame: RgbaImage) -> RgbaImage {
    let mut frame = frame;
    for Rgba([r, g, b, a]) in frame.pixels_mut() {
        if (1..255).contains(a) {
            for channel in [r, g, b] {
                let light = Color::srgb_u8(*channel, 0, 0).to_linear().red / (f32::from(*a) / 255.0);
                *channel = (Srgba::from(LinearRgba::rgb(light.min(1.0), 0.0, 0.0)).red * 255.0).round() as u8;
            }
        }
    }
    frame
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A red cube, half of it lit, is photographed where it is, however large it is: its pictures show it, and nothing
    /// else.
    #[test]
    fn a_model_is_photographed_where_it_is() {
        for size in [1.0, 1e-3, 1e4] {
            photograph_cube(size);
        }
    }

    fn photograph_cube(size: f32) {
        let folder = tempfile::tempdir().unwrap();
        let corners: Vec<[f32; 3]> = (0..8)
            .map(|c| [2.0 + (c & 1) as f32, (c >> 1 & 1) as f32, (c >> 2) as f32].map(|value| size * value))
            .collect();
        let faces: [u16; 36] = [
            0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6,
        ];
        let mut buffer: Vec<u8> = corners.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        buffer.extend(faces.iter().flat_map(|index| index.to_le_bytes()));
        std::fs::write(folder.path().join("cube.bin"), &buffer).unwrap();
        let gltf = json!({
            "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "materials": [{ "pbrMetallicRoughness": { "baseColorFactor": [1.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0 } }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }],
            "buffers": [{ "uri": "cube.bin", "byteLength": buffer.len() }],
            "bufferViews": [{ "buffer": 0, "byteOffset": 0, "byteLength": 96 },
                            { "buffer": 0, "byteOffset": 96, "byteLength": 72 }],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": corners[0], "max": corners[7] },
                { "bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR" },
            ],
        });
        let model = folder.path().join("cube.gltf");
        std::fs::write(&model, gltf.to_string()).unwrap();
        let transforms = photograph(&model, &folder.path().join("pictures"), 3, 24).unwrap();
        let cameras = plenoctree_fit::read_transforms(&transforms, Some((48, 48))).unwrap();
        assert_eq!(cameras.len(), 3);
        for (view, camera) in cameras.iter().enumerate() {
            let picture = image::open(folder.path().join(format!("pictures/view_{view:03}.png"))).unwrap().into_rgba8();
            for (x, y, pixel) in picture.enumerate_pixels() {
                // The cube in the frame of the cameras, whose z is the model's y.
                let (origin, direction) = camera.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let span = |low: DVec3, high: DVec3| {
                    let (a, b) = ((low - origin) / direction, (high - origin) / direction);
                    (a.min(b).max_element(), a.max(b).min_element())
                };
                let (size, margin) = (f64::from(size), 0.08 * f64::from(size));
                let (low, high) = (size * DVec3::new(2.0, -1.0, 0.0), size * DVec3::new(3.0, 0.0, 1.0));
                let (enter, leave) = span(low + margin, high - margin);
                if enter < leave {
                    assert!(pixel[3] == 255 && pixel[0] > 40 && pixel[0] > 2 * pixel[1], "{view} {x} {y} {pixel:?}");
                }
                let (enter, leave) = span(low - margin, high + margin);
                assert!(enter < leave || pixel[3] == 0, "{view} {x} {y} {pixel:?}");
            }
        }
        std::fs::write(&model, "{}").unwrap();
        let error = photograph(&model, &folder.path().join("pictures"), 3, 24).unwrap_err().to_string();
        assert!(error.contains("cube.gltf") && error.lines().count() == 1, "{error}");
    }
}
