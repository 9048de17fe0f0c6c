//! A small scene, photographed from around it, in the formats that inputs have.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::{LazyLock, Mutex},
};

use glam::{DMat3, DQuat, DVec3, DVec4};
use image::{DynamicImage, Rgba, RgbaImage};
use plenoctree::{BakeSettings, Basis, PlenOctree, bake, camera::PinholeCamera, reference::render};

pub const SIZE: u32 = 40;

/// Creates an empty folder for one test.
pub fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fit").join(test);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// A ball of four colors next to a dark post, away from the origin.
pub fn field() -> PlenOctree {
    let settings = BakeSettings { depth: 5, basis: Basis::Rgba, directions: 8, ..Default::default() };
    let inside = |at: DVec3| at.length() < 0.6 || (at.x - 0.7).abs() < 0.1 && at.y.abs() < 0.1 && at.z.abs() < 0.8;
    let color = |at: DVec3| {
        if at.x > 0.6 {
            DVec3::splat(0.15)
        } else {
            DVec3::new(if at.x > 0.0 { 0.9 } else { 0.3 }, if at.y > 0.0 { 0.7 } else { 0.2 }, 0.4 + 0.4 * at.z)
        }
    };
    bake(&settings, |at| if inside(at) { 60.0 } else { 0.0 }, |at| move |_| color(at)).unwrap()
}

/// Cameras around it, higher and lower.
pub fn cameras(count: usize) -> Vec<PinholeCamera> {
    (0..count)
        .map(|index| {
            let (turn, lift) = (2.4 * index as f64, 0.9 * (1.7 * index as f64).sin());
            let outward = DVec3::new(lift.cos() * turn.sin(), lift.cos() * turn.cos(), lift.sin());
            let camera = PinholeCamera::new(SIZE, SIZE, 0.6, glam::DMat4::IDENTITY);
            camera.looking_at(4.0 * outward, DVec3::ZERO, DVec3::Z)
        })
        .collect()
}

/// The color behind the object, on a ray from an origin in a direction.
pub type Background = fn(DVec3, DVec3) -> DVec3;

/// Returns what a camera sees of a field: the mean color and opacity of several rays per pixel, premultiplied.
fn seen(field: &PlenOctree, camera: &PinholeCamera) -> Vec<DVec4> {
    const FINER: u32 = 3;
    let rendering = render(field, &camera.resized(FINER * camera.width, FINER * camera.height));
    let mut pixels = vec![DVec4::ZERO; (camera.width * camera.height) as usize];
    for (index, (color, opacity)) in rendering.color.iter().zip(&rendering.opacity).enumerate() {
        let (x, y) = (index % rendering.width / FINER as usize, index / rendering.width / FINER as usize);
        pixels[y * camera.width as usize + x] += color.extend(*opacity) / f64::from(FINER * FINER);
    }
    pixels
}

/// Makes a picture of what a camera sees. With a `background`, it is opaque.
fn picture(seen: &[DVec4], camera: &PinholeCamera, background: Option<Background>, gain: f64) -> DynamicImage {
    let image = RgbaImage::from_fn(camera.width, camera.height, |x, y| {
        let seen = seen[(y * camera.width + x) as usize];
        let (color, opacity) = (seen.truncate(), seen.w);
        let byte = |x: f64| (255.0 * x.clamp(0.0, 1.0)).round() as u8;
        let (color, opacity) = match background {
            Some(background) => {
                let (origin, direction) = camera.ray(f64::from(x), f64::from(y));
                (gain * (color + (1.0 - opacity) * background(origin, direction)), 1.0)
            }
            None => (gain * color / opacity.max(1e-6), opacity),
        };
        Rgba([byte(color.x), byte(color.y), byte(color.z), byte(opacity)])
    });
    match background {
        Some(_) => DynamicImage::from(image).into_rgb8().into(),
        None => image.into(),
    }
}

/// Writes pictures of [`field`] named `v_0.png` and so on.
pub fn write_pictures(
    folder: &Path,
    cameras: &[PinholeCamera],
    background: Option<Background>,
    gain: impl Fn(usize) -> f64,
) {
    /// What cameras see of it: most tests photograph it from the same places.
    static SEEN: Mutex<BTreeMap<String, Vec<DVec4>>> = Mutex::new(BTreeMap::new());
    static FIELD: LazyLock<PlenOctree> = LazyLock::new(field);
    fs::create_dir_all(folder).unwrap();
    for (index, camera) in cameras.iter().enumerate() {
        let mut all = SEEN.lock().unwrap();
        let seen = all.entry(format!("{camera:?}")).or_insert_with(|| seen(&FIELD, camera));
        picture(seen, camera, background, gain(index)).save(folder.join(format!("v_{index}.png"))).unwrap();
    }
}

/// Writes pictures with opacity of another field.
pub fn write_pictures_of(field: &PlenOctree, folder: &Path, cameras: &[PinholeCamera]) {
    for (index, camera) in cameras.iter().enumerate() {
        picture(&seen(field, camera), camera, None, 1.0).save(folder.join(format!("v_{index}.png"))).unwrap();
    }
}

/// Writes `transforms.json` like NeRF-synthetic's, whose names lack their extension.
pub fn write_transforms(folder: &Path, cameras: &[PinholeCamera]) {
    let frames: Vec<_> = cameras
        .iter()
        .enumerate()
        .map(|(index, camera)| {
            let row = |i: usize| {
                let (m, p) = (camera.rotation, camera.position);
                [m.x_axis[i], m.y_axis[i], m.z_axis[i], p[i]]
            };
            let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
            serde_json::json!({"file_path": format!("./v_{index}"), "transform_matrix": matrix})
        })
        .collect();
    let json = serde_json::json!({"camera_angle_x": 0.6, "frames": frames});
    fs::write(folder.join("transforms.json"), json.to_string()).unwrap();
}

/// The pose that COLMAP writes: from the world to a camera whose y points down and whose z points forward.
pub fn colmap_pose(camera: &PinholeCamera) -> (DQuat, DVec3) {
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let to_camera = (camera.rotation * flip).transpose();
    (DQuat::from_mat3(&to_camera), -(to_camera * camera.position))
}

/// Writes a COLMAP model with these cameras, as text.
pub fn write_colmap_text(folder: &Path, cameras: &[PinholeCamera], camera_line: &str) {
    let model = folder.join("sparse/0");
    fs::create_dir_all(&model).unwrap();
    fs::write(model.join("cameras.txt"), format!("# comment\n{camera_line}\n")).unwrap();
    let mut images = String::from("# comment\n");
    for (index, camera) in cameras.iter().enumerate() {
        let (q, t) = colmap_pose(camera);
        images += &format!("{index} {} {} {} {} {} {} {} 1 v_{index}.png\n\n", q.w, q.x, q.y, q.z, t.x, t.y, t.z);
    }
    fs::write(model.join("images.txt"), images).unwrap();
    fs::write(model.join("points3D.txt"), "# comment\n1 0.1 0.2 0.3 255 0 0 0.5 1 2\n").unwrap();
}

/// Writes the same as `.bin`: `model` is COLMAP's number of the camera model.
pub fn write_colmap_binary(folder: &Path, cameras: &[PinholeCamera], model: u32, parameters: &[f64]) {
    let into = folder.join("sparse");
    fs::create_dir_all(&into).unwrap();
    let mut bytes = 1u64.to_le_bytes().to_vec();
    bytes.extend([1u32, model].map(u32::to_le_bytes).concat());
    bytes.extend([u64::from(SIZE); 2].map(u64::to_le_bytes).concat());
    parameters.iter().for_each(|parameter| bytes.extend(parameter.to_le_bytes()));
    fs::write(into.join("cameras.bin"), bytes).unwrap();
    let mut bytes = (cameras.len() as u64).to_le_bytes().to_vec();
    for (index, camera) in cameras.iter().enumerate() {
        let (q, t) = colmap_pose(camera);
        bytes.extend((index as u32).to_le_bytes());
        bytes.extend([q.w, q.x, q.y, q.z, t.x, t.y, t.z].map(f64::to_le_bytes).concat());
        bytes.extend(1u32.to_le_bytes());
        bytes.extend(format!("v_{index}.png\0").bytes());
        // Two points of the picture, to be skipped.
        bytes.extend(2u64.to_le_bytes());
        bytes.extend([0; 48]);
    }
    fs::write(into.join("images.bin"), bytes).unwrap();
    let mut bytes = 1u64.to_le_bytes().to_vec();
    bytes.extend(7u64.to_le_bytes());
    bytes.extend([0.1, 0.2, 0.3].map(f64::to_le_bytes).concat());
    bytes.extend([0; 11]);
    bytes.extend(2u64.to_le_bytes());
    bytes.extend([0; 16]);
    fs::write(into.join("points3D.bin"), bytes).unwrap();
}
