//! Reads COLMAP models: `cameras`, `images` and `points3D`, as `.bin` or `.txt`.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::Read,
    path::{Path, PathBuf},
    str::FromStr,
};

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{
    lens::{Distortion, Lens},
    parts::{FitInput, InputFolders},
    picture,
    view::{CameraMaker, View},
};
use crate::{
    file::{Bytes, Fault},
    fit::{error::FitError, find},
};

/// Camera models by their number: the name, and the number of parameters.
const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

/// An entry of `cameras`.
struct Camera {
    width: u64,
    height: u64,
    /// An error if it is unknown, which only matters if pictures have it.
    lens: Result<Lens, Fault>,
}

/// An entry of `images`: the pose takes points of the world to the camera, whose y points down.
struct Image {
    rotation: DQuat,
    translation: DVec3,
    camera: u64,
    name: String,
}

/// Reads the model in a folder. The points may be missing.
pub fn read(folder: &Path, folders: &InputFolders) -> Result<FitInput, FitError> {
    let is_binary = folder.join("cameras.bin").exists();
    let cameras_file = folder.join(if is_binary { "cameras.bin" } else { "cameras.txt" });
    let images_file = folder.join(if is_binary { "images.bin" } else { "images.txt" });
    let (cameras, images) = if is_binary {
        (open(&cameras_file, cameras_of)?, open(&images_file, images_of)?)
    } else {
        let lines = Lines::open(cameras_file.clone())?;
        (cameras_of_text(lines)?, images_of_text(Lines::open(images_file.clone())?)?)
    };
    let (binary, text) = (folder.join("points3D.bin"), folder.join("points3D.txt"));
    let points = if binary.exists() {
        open(&binary, points_of)?
    } else if text.exists() {
        points_of_text(Lines::open(text)?)?
    } else {
        Vec::new()
    };
    if images.is_empty() {
        return Err(FitError::found(&images_file, "images", "none", "at least two"));
    }
    if let Some(point) = points.iter().find(|point| !point.is_finite()) {
        return Err(FitError::found(folder, "points3D", point.to_string(), "finite positions"));
    }
    let pictures = pictures(folder, folders, &images)?;
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for image in images {
        match find::picture(&pictures, &image.name, folders.pictures.is_some()) {
            Some(path) => found.push((image, path)),
            None => missing.push(pictures.join(image.name)),
        }
    }
    if let (true, Some(first)) = (found.is_empty(), missing.first()) {
        return Err(FitError::found(folder, "pictures", format!("no file {}", first.display()), "a PNG or JPEG file"));
    }
    let (mut maker, mut notes) = (CameraMaker::default(), Vec::new());
    let views = (found.into_iter())
        .map(|(image, path)| {
            let what = format!("image {}", image.name);
            let camera = cameras.get(&image.camera).ok_or_else(|| {
                FitError::found(&images_file, what.clone(), format!("camera {}", image.camera), "one of the cameras")
            })?;
            let lens = camera.lens.clone().map_err(FitError::fault(&cameras_file))?;
            let size = picture::size(&path)?;
            let stated = (camera.width as f64, camera.height as f64);
            let Some(scale) = picture::scale(size, stated) else {
                let expected =
                    format!("{}x{}, as camera {} states, or a scaled copy", camera.width, camera.height, image.camera);
                return Err(FitError::found(&path, "size", format!("{}x{}", size.0, size.1), expected));
            };
            if scale != DVec2::ONE && notes.is_empty() {
                notes.push(picture::scaled_note(size, stated));
            }
            // As in COLMAP, quaternions of any length are rotations.
            let length = image.rotation.length();
            if !(1e-6..1e6).contains(&length) || !image.translation.as_vec3().is_finite() {
                let expected = "a quaternion and a finite translation";
                return Err(FitError::found(
                    &images_file,
                    what,
                    format!("{} {}", image.rotation, image.translation),
                    expected,
                ));
            }
            let to_world = DMat3::from_quat(image.rotation.normalize()).transpose();
            let position = -(to_world * image.translation);
            let rotation = DMat3::from_cols(to_world.x_axis, -to_world.y_axis, -to_world.z_axis);
            let camera = maker.camera(size.0, size.1, lens.scaled(scale), rotation, position).map_err(|point| {
                let found = format!("a lens without a direction at {point}");
                FitError::found(
                    &cameras_file,
                    format!("camera {}", image.camera),
                    found,
                    "a lens that covers the picture",
                )
            })?;
            Ok(View { name: image.name, picture: path, mask: None, ignored: None, camera })
        })
        .collect::<Result<_, _>>()?;
    Ok(FitInput { views, points, missing, notes })
}

/// Returns whether a folder has a model.
pub fn is_model(folder: &Path) -> bool {
    ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).exists())
}

/// Returns the number of pictures of a model, as it states it. 0 if it cannot be read.
pub fn size(folder: &Path) -> u64 {
    if folder.join("cameras.bin").exists() {
        let mut start = [0; 8];
        let read = File::open(folder.join("images.bin")).and_then(|mut file| file.read_exact(&mut start));
        return read.map_or(0, |()| u64::from_le_bytes(start));
    }
    Lines::open(folder.join("images.txt")).and_then(images_of_text).map_or(0, |images| images.len() as u64)
}

/// Finds the folder of the pictures: that with the most of them.
fn pictures(folder: &Path, folders: &InputFolders, images: &[Image]) -> Result<PathBuf, FitError> {
    if let Some(pictures) = &folders.pictures {
        return Ok(pictures.clone());
    }
    let absolute = fs::canonicalize(folder).map_err(FitError::io(folder))?;
    let mut best: (usize, Option<PathBuf>) = (0, None);
    for pictures in absolute.ancestors().take(4).flat_map(|above| [above.join("images"), above.into()]) {
        let found = images.iter().filter(|image| find::picture(&pictures, &image.name, false).is_some()).count();
        if found > best.0 {
            best = (found, Some(pictures));
        }
        if found == images.len() {
            break;
        }
    }
    best.1.ok_or_else(|| {
        let first = images.first().map_or("", |image| &image.name);
        let expected = "pictures in a folder `images` next to the model or above it";
        FitError::found(folder, "pictures", format!("no {first}, nor any other"), expected)
    })
}

/// Makes a lens from the parameters of a camera model.
fn lens(camera: u64, model: &str, p: &[f64]) -> Result<Lens, Fault> {
    let what = format!("camera {camera}");
    let count = MODELS.iter().find(|(name, _)| *name == model).map(|(_, count)| *count);
    if count.is_some_and(|count| count != p.len()) {
        return Err(Fault::found(what, format!("{} parameters", p.len()), format!("those of {model}")));
    }
    let radial = |k1, k2, p1, p2| match [k1, k2, p1, p2] {
        [0.0, 0.0, 0.0, 0.0] => Distortion::None,
        _ => Distortion::Radial { radial: [k1, k2, 0.0, 0.0], divisor: [0.0; 3], tangential: [p1, p2] },
    };
    let one_focal = || (DVec2::splat(p[0]), DVec2::new(p[1], p[2]));
    let two_focals = || (DVec2::new(p[0], p[1]), DVec2::new(p[2], p[3]));
    let ((focal, center), distortion) = match model {
        "SIMPLE_PINHOLE" => (one_focal(), Distortion::None),
        "PINHOLE" => (two_focals(), Distortion::None),
        "SIMPLE_RADIAL" => (one_focal(), radial(p[3], 0.0, 0.0, 0.0)),
        "RADIAL" => (one_focal(), radial(p[3], p[4], 0.0, 0.0)),
        "OPENCV" => (two_focals(), radial(p[4], p[5], p[6], p[7])),
        "OPENCV_FISHEYE" => (two_focals(), Distortion::Fisheye([p[4], p[5], p[6], p[7]])),
        "FULL_OPENCV" => {
            let (radial, divisor) = ([p[4], p[5], p[8], 0.0], [p[9], p[10], p[11]]);
            (two_focals(), Distortion::Radial { radial, divisor, tangential: [p[6], p[7]] })
        }
        "SIMPLE_FISHEYE" => (one_focal(), Distortion::Fisheye([0.0; 4])),
        "FISHEYE" => (two_focals(), Distortion::Fisheye([0.0; 4])),
        "SIMPLE_RADIAL_FISHEYE" => (one_focal(), Distortion::Fisheye([p[3], 0.0, 0.0, 0.0])),
        "RADIAL_FISHEYE" => (one_focal(), Distortion::Fisheye([p[3], p[4], 0.0, 0.0])),
        other => {
            let expected = "SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, OPENCV_FISHEYE, \
                            SIMPLE_FISHEYE, FISHEYE, SIMPLE_RADIAL_FISHEYE or RADIAL_FISHEYE (or undistort the \
                            pictures with COLMAP's image_undistorter)";
            return Err(Fault::found(what, format!("model {other}"), expected));
        }
    };
    if p.iter().any(|p| !p.is_finite() || p.abs() > 1e7) || focal.min_element() < 1e-3 {
        return Err(Fault::found(what, format!("parameters {p:?}"), "finite numbers, and focal lengths above 0"));
    }
    Ok(Lens { focal, center, distortion })
}

/// Reads a binary file.
fn open<T>(path: &Path, parse: impl FnOnce(&mut Bytes) -> Result<T, Fault>) -> Result<T, FitError> {
    let bytes = fs::read(path).map_err(FitError::io(path))?;
    parse(&mut Bytes::new(&bytes)).map_err(FitError::fault(path))
}

fn vector(file: &mut Bytes, what: &str) -> Result<DVec3, Fault> {
    Ok(DVec3::new(file.f64(what)?, file.f64(what)?, file.f64(what)?))
}

/// Adds a camera, unless there is one of its number.
fn add(cameras: &mut BTreeMap<u64, Camera>, number: u64, camera: Camera) -> Result<(), Fault> {
    match cameras.insert(number, camera) {
        Some(_) => Err(Fault::found(format!("camera {number}"), "two of this number", "one")),
        None => Ok(()),
    }
}

fn cameras_of(file: &mut Bytes) -> Result<BTreeMap<u64, Camera>, Fault> {
    const WHAT: &str = "cameras";
    let mut cameras = BTreeMap::new();
    for _ in 0..file.u64(WHAT)? {
        let (id, model) = (file.u32(WHAT)?.into(), file.u32(WHAT)?);
        let (width, height) = (file.u64(WHAT)?, file.u64(WHAT)?);
        let Some((name, count)) = MODELS.get(model as usize) else {
            let expected = "one from 0 (SIMPLE_PINHOLE) to 17 (EQUIRECTANGULAR)";
            return Err(Fault::found(format!("camera {id}"), format!("model {model}"), expected));
        };
        let parameters = (0..*count).map(|_| file.f64(WHAT)).collect::<Result<Vec<_>, _>>()?;
        add(&mut cameras, id, Camera { width, height, lens: lens(id, name, &parameters) })?;
    }
    Ok(cameras)
}

fn images_of(file: &mut Bytes) -> Result<Vec<Image>, Fault> {
    const WHAT: &str = "images";
    let mut images = Vec::new();
    for _ in 0..file.u64(WHAT)? {
        file.u32(WHAT)?;
        let (w, axis) = (file.f64(WHAT)?, vector(file, WHAT)?);
        let rotation = DQuat::from_xyzw(axis.x, axis.y, axis.z, w);
        let (translation, camera, name) = (vector(file, WHAT)?, file.u32(WHAT)?.into(), file.text(WHAT)?);
        let points = file.u64(WHAT)?;
        file.take(points.saturating_mul(24), WHAT)?;
        images.push(Image { rotation, translation, camera, name });
    }
    Ok(images)
}

fn points_of(file: &mut Bytes) -> Result<Vec<DVec3>, Fault> {
    const WHAT: &str = "points3D";
    let mut points = Vec::new();
    for _ in 0..file.u64(WHAT)? {
        file.u64(WHAT)?;
        points.push(vector(file, WHAT)?);
        // Color and error.
        file.take(3 + 8, WHAT)?;
        let track = file.u64(WHAT)?;
        file.take(track.saturating_mul(8), WHAT)?;
    }
    Ok(points)
}

/// A text file being read, without comments.
struct Lines {
    path: PathBuf,
    text: String,
}

impl Lines {
    fn open(path: PathBuf) -> Result<Self, FitError> {
        let text = fs::read_to_string(&path).map_err(FitError::io(&path))?;
        Ok(Self { path, text })
    }

    /// Returns the numbers and the words of each line. Numbers count from 1.
    fn entries(&self) -> impl Iterator<Item = (usize, Vec<&str>)> {
        // Some editors write a byte order mark.
        let lines = (1..).zip(self.text.trim_start_matches('\u{feff}').lines());
        lines
            .filter(|(_, line)| !line.trim_start().starts_with('#'))
            .map(|(number, line)| (number, line.split_whitespace().collect()))
    }

    fn value<T: FromStr>(&self, (number, words): &(usize, Vec<&str>), index: usize) -> Result<T, FitError> {
        let word = words.get(index).copied();
        word.and_then(|word| word.parse().ok()).ok_or_else(|| {
            let found = word.map_or("the end of the line".into(), |word| format!("`{word}`"));
            FitError::found(&self.path, format!("line {number}"), found, format!("a number as word {}", index + 1))
        })
    }
}

fn cameras_of_text(file: Lines) -> Result<BTreeMap<u64, Camera>, FitError> {
    let mut cameras = BTreeMap::new();
    for line in file.entries().filter(|(_, words)| !words.is_empty()) {
        let id = file.value(&line, 0)?;
        let (width, height) = (file.value(&line, 2)?, file.value(&line, 3)?);
        let parameters = (4..line.1.len()).map(|index| file.value(&line, index)).collect::<Result<Vec<_>, _>>()?;
        let camera = Camera { width, height, lens: lens(id, line.1[1], &parameters) };
        add(&mut cameras, id, camera).map_err(FitError::fault(&file.path))?;
    }
    Ok(cameras)
}

fn images_of_text(file: Lines) -> Result<Vec<Image>, FitError> {
    let mut images = Vec::new();
    let mut lines = file.entries().peekable();
    while let Some(line) = lines.by_ref().find(|(_, words)| !words.is_empty()) {
        let number = |index| file.value::<f64>(&line, index);
        images.push(Image {
            rotation: DQuat::from_xyzw(number(2)?, number(3)?, number(4)?, number(1)?),
            translation: DVec3::new(number(5)?, number(6)?, number(7)?),
            camera: file.value(&line, 8)?,
            name: file.value::<String>(&line, 9).map(|_| line.1[9..].join(" "))?,
        });
        // The line behind an image's lists its points: three numbers each. It may be empty, and some files leave it out.
        let are_numbers = |words: &[&str]| words.iter().all(|word| word.parse::<f64>().is_ok());
        lines.next_if(|(_, words)| words.len() % 3 == 0 && are_numbers(words));
    }
    Ok(images)
}

fn points_of_text(file: Lines) -> Result<Vec<DVec3>, FitError> {
    file.entries()
        .filter(|(_, words)| !words.is_empty())
        .map(|line| Ok(DVec3::new(file.value(&line, 1)?, file.value(&line, 2)?, file.value(&line, 3)?)))
        .collect()
}
