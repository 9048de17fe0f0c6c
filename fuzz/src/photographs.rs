//! Generates inputs of fits, and checks their reader.

use std::{fs, path::Path};

use arbitrary::Arbitrary;
use glam::DVec2;
use miniz_oxide::deflate::compress_to_vec_zlib;
use plenoctree_fit::{FitError, FitInput, InputFolders, Picture, View};

use crate::{message::check_message, scratch::Scratch};

/// A folder with a picture, and the files that say how it was taken.
#[derive(Arbitrary, Debug)]
pub struct Photographs<'a> {
    size: [u8; 2],
    picture: Content<'a>,
    cameras: Cameras<'a>,
}

#[derive(Arbitrary, Debug)]
enum Content<'a> {
    /// A valid picture, except for the size that it claims and its last bytes.
    Valid {
        claimed: Option<[u32; 2]>,
        cut: u8,
    },
    Bytes(&'a [u8]),
}

#[derive(Arbitrary, Debug)]
enum Cameras<'a> {
    /// A `transforms.json` with these keys of the camera.
    Transforms(Vec<(u8, f64)>, Vec<[f64; 4]>),
    TransformsText(&'a [u8]),
    /// A COLMAP model.
    Model {
        binary: bool,
        model: u8,
        parameters: Vec<f64>,
        images: Vec<[f64; 7]>,
        points: Vec<[f64; 3]>,
        edits: Vec<(u8, u16, u8)>,
    },
    /// The three files of a COLMAP model.
    ModelBytes(bool, [&'a [u8]; 3]),
}

const PICTURE: &str = "a.png";
const KEYS: [&str; 14] =
    ["camera_angle_x", "w", "h", "fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "camera_angle_y"];
const FILES: [&str; 3] = ["cameras", "images", "points3D"];
const MODELS: [(&str, usize); 6] =
    [("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8), ("OPENCV_FISHEYE", 8)];

impl Photographs<'_> {
    fn write(&self, folder: &Path) -> std::io::Result<()> {
        let [width, height] = self.size.map(|side| u32::from(side % 16) + 1);
        let picture = match self.picture {
            Content::Valid { claimed, cut } => {
                let mut bytes = png([width, height], claimed.unwrap_or([width, height]));
                bytes.truncate(bytes.len() - usize::from(cut % 32));
                bytes
            }
            Content::Bytes(bytes) => bytes.to_vec(),
        };
        fs::write(folder.join(PICTURE), picture)?;
        match &self.cameras {
            Cameras::TransformsText(text) => fs::write(folder.join("transforms.json"), text),
            Cameras::Transforms(keys, poses) => {
                let keys = keys.iter().map(|(key, value)| (KEYS[usize::from(*key) % KEYS.len()], value));
                let keys: String = keys.map(|(key, value)| format!("\"{key}\": {value:?}, ")).collect();
                let frame = |[turn, x, y, z]: &[f64; 4]| {
                    let (sin, cos) = turn.sin_cos();
                    let rows = [[cos, 0.0, sin, *x], [0.0, 1.0, 0.0, *y], [-sin, 0.0, cos, *z], [0.0, 0.0, 0.0, 1.0]];
                    format!("{{\"file_path\": \"{PICTURE}\", \"transform_matrix\": {rows:?}}}")
                };
                let frames: Vec<String> = poses.iter().map(frame).collect();
                let text = format!("{{{keys}\"frames\": [{}]}}", frames.join(", "));
                fs::write(folder.join("transforms.json"), text)
            }
            Cameras::Model { binary, model, parameters, images, points, edits } => {
                let number = usize::from(*model) % MODELS.len();
                let (name, count) = MODELS[number];
                let parameters: Vec<f64> = parameters.iter().copied().chain([8.0; 8]).take(count).collect();
                let mut files = if *binary {
                    binary_model([width, height], number, &parameters, images, points)
                } else {
                    text_model([width, height], name, &parameters, images, points)
                };
                for (file, at, byte) in edits {
                    let file = &mut files[usize::from(*file) % FILES.len()];
                    if let Some(old) = file.get_mut(usize::from(*at)) {
                        *old = *byte;
                    }
                }
                write_model(folder, *binary, files.each_ref().map(Vec::as_slice))
            }
            Cameras::ModelBytes(binary, files) => write_model(folder, *binary, *files),
        }
    }
}

fn write_model(folder: &Path, binary: bool, files: [&[u8]; 3]) -> std::io::Result<()> {
    let ending = if binary { "bin" } else { "txt" };
    FILES.iter().zip(files).try_for_each(|(name, bytes)| fs::write(folder.join(format!("{name}.{ending}")), bytes))
}

fn binary_model(
    size: [u32; 2],
    model: usize,
    parameters: &[f64],
    images: &[[f64; 7]],
    points: &[[f64; 3]],
) -> [Vec<u8>; 3] {
    let floats = |numbers: &[f64]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<_>>();
    let count = |count: usize| (count as u64).to_le_bytes().to_vec();
    let [width, height] = size.map(|side| u64::from(side).to_le_bytes().to_vec());
    let camera = [1u32.to_le_bytes(), (model as u32).to_le_bytes()].concat();
    let cameras = [count(1), camera, width, height, floats(parameters)].concat();
    let image = |pose: &[f64; 7]| {
        let end = [b"a.png\0".to_vec(), count(0)].concat();
        [1u32.to_le_bytes().to_vec(), floats(pose), 1u32.to_le_bytes().to_vec(), end].concat()
    };
    let point = |place: &[f64; 3]| [count(1), floats(place), vec![0; 3], floats(&[1.0]), count(0)].concat();
    [
        cameras,
        [count(images.len()), images.iter().flat_map(image).collect()].concat(),
        [count(points.len()), points.iter().flat_map(point).collect()].concat(),
    ]
}

fn text_model(
    [width, height]: [u32; 2],
    model: &str,
    parameters: &[f64],
    images: &[[f64; 7]],
    points: &[[f64; 3]],
) -> [Vec<u8>; 3] {
    let words = |numbers: &[f64]| numbers.iter().map(|number| format!(" {number:?}")).collect::<String>();
    let cameras = format!("# Cameras\n1 {model} {width} {height}{}\n", words(parameters));
    let image = |pose: &[f64; 7]| format!("1{} 1 {PICTURE}\n\n", words(pose));
    let point = |place: &[f64; 3]| format!("1{} 0 0 0 1.0\n", words(place));
    [cameras, images.iter().map(image).collect(), points.iter().map(point).collect()].map(String::into_bytes)
}

/// Returns a gray PNG file of `size` that claims to have another one.
fn png(size: [u32; 2], claimed: [u32; 2]) -> Vec<u8> {
    let [width, height] = size.map(|side| side as usize);
    let chunk = |name: &[u8; 4], content: &[u8]| {
        let sum = crc32fast::hash(&[name.as_slice(), content].concat());
        [&(content.len() as u32).to_be_bytes(), name.as_slice(), content, &sum.to_be_bytes()].concat()
    };
    let header = [&claimed[0].to_be_bytes()[..], &claimed[1].to_be_bytes(), &[8, 0, 0, 0, 0]].concat();
    let pixels = compress_to_vec_zlib(&vec![0; (width + 1) * height], 1);
    [b"\x89PNG\r\n\x1a\n".to_vec(), chunk(b"IHDR", &header), chunk(b"IDAT", &pixels), chunk(b"IEND", &[])].concat()
}

/// Checks that a folder gives valid views or a valid error message.
pub fn check_photographs(photographs: &Photographs) {
    let folder = Scratch::new("photographs");
    photographs.write(folder.path()).expect("a directory for temporary files");
    match FitInput::read(folder.path(), &InputFolders::default()) {
        Ok(input) => {
            assert!(!input.views.is_empty());
            assert!(input.points.iter().all(|point| point.is_finite()), "{:?}", input.points);
            input.views.iter().for_each(check_view);
        }
        Err(error) => check_error(&error),
    }
}

fn check_view(view: &View) {
    let camera = &view.camera;
    assert!(camera.position.as_vec3().is_finite(), "{camera:?}");
    let size = DVec2::new(camera.width.into(), camera.height.into());
    for share in [DVec2::ZERO, DVec2::new(1.0, 0.0), DVec2::new(0.3, 0.9), DVec2::ONE] {
        let direction = camera.direction(share * size);
        assert!(direction.is_normalized(), "{direction} at {share}: {camera:?}");
    }
    match Picture::read(&view.picture, view.mask.as_deref(), 2) {
        Ok(picture) => assert_eq!(picture.pixels.len(), (picture.width * picture.height) as usize),
        Err(error) => check_error(&error),
    }
}

fn check_error(error: &FitError) {
    // It may quote a path, a name and a key.
    check_message(error, 4096);
}
