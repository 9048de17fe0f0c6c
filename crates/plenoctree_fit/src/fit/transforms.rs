//! Reads the camera files of NeRF, nerfstudio and instant-ngp.

use std::{
    fs,
    ops::RangeInclusive,
    path::{Path, PathBuf},
};

use glam::{DMat3, DMat4, DVec2, DVec4};
use plenoctree::camera::PinholeCamera;
use serde::Deserialize;
use serde_json::Value;

use super::{error::FitError, find};
use crate::file::{printable, without_mark};

/// The key of a frame's pose.
const MATRIX: &str = "transform_matrix";
/// A key of the file, what was found there, and what was expected.
pub(crate) type WrongValue = (&'static str, String, &'static str);

/// Camera intrinsics, for all frames or for a single frame. The latter take precedence.
#[derive(Clone, Copy, Default)]
pub(crate) struct Intrinsics {
    pub w: Option<f64>,
    pub h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
}

impl Intrinsics {
    fn of(entry: &Value) -> Result<Self, WrongValue> {
        Ok(Self {
            w: number(entry, "w")?,
            h: number(entry, "h")?,
            fl_x: number(entry, "fl_x")?,
            fl_y: number(entry, "fl_y")?,
            cx: number(entry, "cx")?,
            cy: number(entry, "cy")?,
            camera_angle_x: number(entry, "camera_angle_x")?,
            camera_angle_y: number(entry, "camera_angle_y")?,
        })
    }

    /// Returns whether a focal length is in pixels, not an angle.
    pub fn is_in_pixels(&self) -> bool {
        self.fl_x.or(self.fl_y).is_some()
    }

    /// Returns which of the focal lengths are there, in pixels or as angles.
    fn axes(&self) -> [bool; 2] {
        [self.fl_x.or(self.camera_angle_x), self.fl_y.or(self.camera_angle_y)].map(|focal| focal.is_some())
    }

    pub fn or(self, other: Self) -> Self {
        // If a frame replaces one of the file's focal lengths, the other one is that of another zoom.
        let replaces = self.axes().into_iter().zip(other.axes()).any(|(own, others)| own && others);
        let focal = if replaces { Self::default() } else { other };
        Self {
            w: self.w.or(other.w),
            h: self.h.or(other.h),
            fl_x: self.fl_x.or(focal.fl_x),
            fl_y: self.fl_y.or(focal.fl_y),
            cx: self.cx.or(other.cx),
            cy: self.cy.or(other.cy),
            camera_angle_x: self.camera_angle_x.or(focal.camera_angle_x),
            camera_angle_y: self.camera_angle_y.or(focal.camera_angle_y),
        }
    }

    /// Returns the focal lengths and the point of the optical axis, in pixels of images of this size.
    pub fn focal_and_center(&self, size: DVec2) -> Result<(DVec2, DVec2), WrongValue> {
        let focal = |key, focal: f64| {
            if FOCAL.contains(&focal) { Ok(focal) } else { Err((key, format!("{focal:?}"), "1e-6 to 1e9 pixels")) }
        };
        let from_angle = |key, angle: f64, pixels: f64| {
            let focal = 0.5 * pixels / (0.5 * angle).tan();
            if angle > 0.0 && angle < std::f64::consts::PI && FOCAL.contains(&focal) {
                Ok(focal)
            } else {
                Err((key, format!("{angle:?}"), "an angle between 0 and pi radians"))
            }
        };
        let center = |key, given: Option<f64>, pixels: f64| {
            let center = given.unwrap_or(0.5 * pixels);
            if center.abs() <= MAX_CENTER {
                Ok(center)
            } else {
                Err((key, format!("{center:?}"), "-1e9 to 1e9 pixels"))
            }
        };
        let along = |[in_pixels, as_angle]: [&'static str; 2], given: Option<f64>, angle: Option<f64>, pixels| match (
            given, angle,
        ) {
            (Some(given), _) => focal(in_pixels, given).map(Some),
            (None, Some(angle)) => from_angle(as_angle, angle, pixels).map(Some),
            (None, None) => Ok(None),
        };
        let x = along(["fl_x", "camera_angle_x"], self.fl_x, self.camera_angle_x, size.x)?;
        let y = along(["fl_y", "camera_angle_y"], self.fl_y, self.camera_angle_y, size.y)?;
        // Pixels are square unless both are given.
        let Some((x, y)) = x.or(y).zip(y.or(x)) else {
            return Err(("camera_angle_x", "nothing".into(), "camera_angle_x, fl_x, camera_angle_y or fl_y"));
        };
        Ok((DVec2::new(x, y), DVec2::new(center("cx", self.cx, size.x)?, center("cy", self.cy, size.y)?)))
    }
}

/// The camera models that pictures may have. All others distort.
const MODELS: [&str; 6] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV_FISHEYE"];

/// The keys of a lens's distortion: k1 to k4 of its polynomial, and p1 and p2.
pub(crate) const DISTORTION: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];

/// The camera of all frames or of one, which takes precedence.
#[derive(Clone, Default)]
pub(crate) struct Camera {
    pub camera_model: Option<String>,
    pub is_fisheye: Option<bool>,
    pub intrinsics: Intrinsics,
    /// The coefficients of [`DISTORTION`].
    distortion: [Option<f64>; 6],
}

impl Camera {
    fn of(entry: &Value) -> Result<Self, WrongValue> {
        let mut distortion = [None; 6];
        for (coefficient, key) in distortion.iter_mut().zip(DISTORTION) {
            *coefficient = number(entry, key)?;
        }
        Ok(Self {
            camera_model: text(entry, "camera_model")?,
            is_fisheye: value(entry, "is_fisheye", "true or false", Value::as_bool)?,
            intrinsics: Intrinsics::of(entry)?,
            distortion,
        })
    }

    pub fn or(self, other: Self) -> Self {
        Self {
            camera_model: self.camera_model.or(other.camera_model),
            is_fisheye: self.is_fisheye.or(other.is_fisheye),
            intrinsics: self.intrinsics.or(other.intrinsics),
            distortion: std::array::from_fn(|i| self.distortion[i].or(other.distortion[i])),
        }
    }

    /// Returns the coefficients of [`DISTORTION`].
    pub fn distortion(&self) -> [f64; 6] {
        self.distortion.map(Option::unwrap_or_default)
    }

    pub fn is_fisheye(&self) -> bool {
        self.is_fisheye == Some(true) || self.camera_model.as_deref() == Some("OPENCV_FISHEYE")
    }

    /// Returns the name of the camera's model if it is none of [`MODELS`].
    pub fn unknown_model(&self) -> Option<&str> {
        self.camera_model.as_deref().filter(|model| !MODELS.contains(model))
    }

    /// Returns whether the lens distorts.
    fn distorts(&self) -> bool {
        self.distortion() != [0.0; 6] || self.is_fisheye() || self.unknown_model().is_some()
    }
}

/// A file of cameras, with at least one frame.
pub(crate) struct File {
    pub camera: Camera,
    pub frames: Vec<Frame>,
    pub ply_file_path: Option<String>,
}

/// A picture with its camera.
pub(crate) struct Frame {
    pub camera: Camera,
    /// The path of the picture.
    pub name: Option<String>,
    pub mask_path: Option<String>,
    /// The frame as it is written.
    entry: Value,
}

impl File {
    pub fn read(path: &Path) -> Result<Self, FitError> {
        const FRAMES: &str = "frames";
        let bytes = fs::read(path).map_err(FitError::io(path))?;
        let mut file: Value = serde_json::from_slice(without_mark(&bytes))
            .map_err(|error| FitError::found(path, "file", error.to_string(), "a transforms.json file"))?;
        let frames = match file.get_mut(FRAMES).map(Value::take) {
            Some(Value::Array(frames)) if !frames.is_empty() => frames,
            found => {
                return Err(FitError::found(
                    path,
                    FRAMES,
                    described(&found.unwrap_or_default()),
                    "a list of at least one frame",
                ));
            }
        };
        let frames = (frames.into_iter().enumerate())
            .map(|(index, entry)| {
                Frame::of(entry).map_err(|(key, found, expected)| {
                    FitError::found(path, format!("{FRAMES}[{index}].{key}"), found, expected)
                })
            })
            .collect::<Result<_, _>>()?;
        let common = || Ok((Camera::of(&file)?, text(&file, "ply_file_path")?));
        let (camera, ply_file_path) =
            common().map_err(|(key, found, expected)| FitError::found(path, key, found, expected))?;
        Ok(Self { camera, frames, ply_file_path })
    }

    /// Returns an error about a value of a frame, which may be that of all frames.
    pub fn fault(&self, path: &Path, index: usize, (key, found, expected): WrongValue) -> FitError {
        let is_own = key == MATRIX || self.frames[index].entry.get(key).is_some();
        let what = if is_own { format!("frames[{index}].{key}") } else { key.into() };
        FitError::found(path, what, found, expected)
    }
}

impl Frame {
    fn of(entry: Value) -> Result<Self, WrongValue> {
        let camera = Camera::of(&entry)?;
        let name = text(&entry, "file_path")?.map_or_else(|| text(&entry, "file"), |name| Ok(Some(name)))?;
        Ok(Self { camera, name, mask_path: text(&entry, "mask_path")?, entry })
    }

    /// Returns the camera's pose, a pure rotation and a translation.
    pub fn pose(&self) -> Result<DMat4, WrongValue> {
        let wrong =
            |found| Err((MATRIX, found, "a 4x4 camera-to-world matrix, row by row, a rotation and a translation"));
        let entry = &self.entry[MATRIX];
        let rows = entry.as_array().map_or(&[][..], Vec::as_slice);
        let row = |row: &Value| Some(DVec4::from_array(Deserialize::deserialize(row).ok()?));
        let rows: Vec<Option<DVec4>> = rows.iter().map(row).collect();
        let (Some(x), Some(y), Some(z), last) = (match rows[..] {
            [x, y, z] => (x, y, z, Some(DVec4::W)),
            [x, y, z, last] => (x, y, z, last),
            _ => (None, None, None, None),
        }) else {
            return wrong(described(entry));
        };
        if last != Some(DVec4::W) {
            return wrong(format!("a last row of {}", described(&entry[3])));
        }
        let matrix = DMat4::from_cols(x, y, z, DVec4::W).transpose();
        if !matrix.as_mat4().is_finite() {
            return wrong("a number beyond the range of float32".into());
        }
        let axes = DMat3::from_mat4(matrix);
        let determinant = axes.determinant();
        let rotation = axes * determinant.cbrt().recip();
        let skew = rotation * rotation.transpose() - DMat3::IDENTITY;
        if determinant <= 0.0 || !skew.to_cols_array().iter().all(|x| x.abs() < 1e-2) {
            return wrong(format!("axes that are not a rotation (determinant {determinant:.3})"));
        }
        let mut pose = DMat4::from_mat3(rotation);
        pose.w_axis = matrix.w_axis;
        Ok(pose)
    }
}

/// Returns the value of a key, or an error if it is not what is expected. Null counts as none.
fn value<T>(
    entry: &Value,
    key: &'static str,
    expected: &'static str,
    read: impl Fn(&Value) -> Option<T>,
) -> Result<Option<T>, WrongValue> {
    match entry.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(found) => read(found).map(Some).ok_or_else(|| (key, described(found), expected)),
    }
}

fn number(entry: &Value, key: &'static str) -> Result<Option<f64>, WrongValue> {
    value(entry, key, "a number", Value::as_f64)
}

fn text(entry: &Value, key: &'static str) -> Result<Option<String>, WrongValue> {
    value(entry, key, "a text", |value| value.as_str().map(String::from))
}

/// Returns a value as it is written, or its beginning.
fn described(value: &Value) -> String {
    if value.is_null() { "nothing".into() } else { printable(&value.to_string()) }
}

/// What a `transforms.json` file says of its pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Transforms {
    /// The cameras, one per frame. They do not distort.
    pub cameras: Vec<PinholeCamera>,
    /// The paths of the pictures and masks of frames that name one, where they are or, if there is no such file, where
    /// they would be.
    pub pictures: Vec<PathBuf>,
    /// Whether the file says that a lens distorts.
    pub is_distorted: bool,
}

/// Width of images if the file specifies neither width nor height.
const DEFAULT_WIDTH: f64 = 800.0;
/// Maximum width and height of an image, in pixels.
const MAX_SIZE: f64 = 16384.0;
/// Range of focal lengths, in pixels, in which every ray has a direction.
const FOCAL: RangeInclusive<f64> = 1e-6..=1e9;
/// Maximum distance of the optical axis from the image's corner, in pixels.
const MAX_CENTER: f64 = 1e9;

/// Reads the cameras of a `transforms.json` file, one per frame: those of [`Transforms::read`].
///
/// # Errors
///
/// Returns the same errors.
pub fn read_transforms(path: impl AsRef<Path>, size: Option<(u32, u32)>) -> Result<Vec<PinholeCamera>, FitError> {
    Ok(Transforms::read(path, size)?.cameras)
}

impl Transforms {
    /// Reads a file, in its order and frame of reference.
    ///
    /// `w`, `h`, `fl_x`, `fl_y`, `cx` and `cy` are read from each frame, or else from the top level of the file.
    /// Missing values have defaults:
    ///
    /// - `fl_x` and `fl_y` are computed from `camera_angle_x` and `camera_angle_y`, in radians. One of the four is
    ///   required, and both focal lengths are equal if only one is given. A frame that replaces one of the file's does
    ///   not inherit the other one.
    /// - `cx` and `cy` are the middle of the image.
    /// - `w` is 800 pixels, or follows from `h` and the aspect ratio. `h` follows from `w` and the aspect ratio, which is
    ///   that of `size`, or else a square's.
    ///
    /// If `size` is given, all views are rescaled to that width and height, so that they show the same at any size.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, is not valid JSON, has no frames, or has a missing or out-of-range
    /// value.
    pub fn read(path: impl AsRef<Path>, size: Option<(u32, u32)>) -> Result<Self, FitError> {
        let path = path.as_ref();
        let file = File::read(path)?;
        let cameras: Result<_, _> = (file.frames.iter().enumerate())
            .map(|(index, frame)| {
                let intrinsics = frame.camera.intrinsics.or(file.camera.intrinsics);
                let camera = frame.pose().and_then(|pose| pinhole(intrinsics, pose, size));
                camera.map_err(|wrong| file.fault(path, index, wrong))
            })
            .collect();
        let folder = find::folder_of(path);
        let at = |name: &String| find::picture(folder, name, false).unwrap_or_else(|| folder.join(name));
        Ok(Self {
            cameras: cameras?,
            pictures: file.frames.iter().flat_map(|frame| frame.name.iter().chain(&frame.mask_path)).map(at).collect(),
            is_distorted: file.camera.distorts() || file.frames.iter().any(|frame| frame.camera.distorts()),
        })
    }
}

fn pinhole(given: Intrinsics, pose: DMat4, size: Option<(u32, u32)>) -> Result<PinholeCamera, WrongValue> {
    let pixels = |key, value: f64| {
        if value.fract() == 0.0 && (1.0..=MAX_SIZE).contains(&value) {
            Ok(value)
        } else {
            Err((key, format!("{value:?}"), "a whole number of pixels from 1 to 16384"))
        }
    };
    // Height by width.
    let aspect = size.map_or(1.0, |(width, height)| f64::from(height) / f64::from(width));
    let own_width = given.w.map(|w| pixels("w", w)).transpose()?;
    let own_height = given.h.map(|h| pixels("h", h)).transpose()?;
    let width = own_width.or(own_height.map(|height| height / aspect)).unwrap_or(DEFAULT_WIDTH);
    let height = own_height.unwrap_or(width * aspect);
    let (focal, center) = given.focal_and_center(DVec2::new(width, height))?;
    // Without a size, the own one is whole: it is given or square.
    let (new_width, new_height) = size.unwrap_or((width as u32, height as u32));
    let (x, y) = (f64::from(new_width) / width, f64::from(new_height) / height);
    Ok(PinholeCamera {
        width: new_width,
        height: new_height,
        focal_x: x * focal.x,
        focal_y: y * focal.y,
        center_x: x * center.x,
        center_y: y * center.y,
        rotation: DMat3::from_mat4(pose),
        position: pose.w_axis.truncate(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str, size: Option<(u32, u32)>) -> Result<Vec<PinholeCamera>, FitError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("transforms.json");
        fs::write(&path, json).unwrap();
        read_transforms(&path, size)
    }

    const POSE: &str = r#""transform_matrix": [[1,0,0,4],[0,1,0,5],[0,0,1,6],[0,0,0,1]]"#;

    /// Pictures are those that `fit` reads, and distortion is noticed wherever it is written.
    #[test]
    fn pictures_and_distortion_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("transforms.json");
        let read = |common: &str, own: &str| {
            let json = format!(
                r#"{{{common} "camera_angle_x": 1, "frames": [{{"file_path": "a", "file": "no", {POSE}}},
                    {{"file": "b/c.png", {own} {POSE}}}, {{{POSE}}}]}}"#
            );
            // Some editors write a byte order mark.
            fs::write(&path, format!("\u{feff}{json}")).unwrap();
            Transforms::read(&path, None).unwrap()
        };
        let found = read(r#""k1": 0, "camera_model": "OPENCV","#, "");
        assert_eq!(found.pictures, ["a", "b/c.png"].map(|name| path.with_file_name(name)));
        assert_eq!((found.cameras.len(), found.is_distorted), (3, false));
        assert!(read(r#""k1": 0.1,"#, "").is_distorted && read("", r#""p2": -1e-3,"#).is_distorted);
        assert!(read(r#""camera_model": "OPENCV_FISHEYE","#, "").is_distorted);
        assert!(read("", r#""camera_model": "EQUIRECTANGULAR","#).is_distorted);
        assert!(read("", r#""is_fisheye": true,"#).is_distorted);
    }

    #[test]
    fn nerf_files_have_square_pixels_and_a_central_axis() {
        let json = format!(r#"{{"camera_angle_x": 1.5707963267948966, "frames": [{{"file_path": "a", {POSE}}}]}}"#);
        let camera = read(&json, Some((200, 100))).unwrap()[0];
        let (origin, direction) = camera.ray(100.0, 50.0);
        assert_eq!(origin.to_array(), [4.0, 5.0, 6.0]);
        assert_eq!(direction.to_array(), [0.0, 0.0, -1.0]);
        // 45 degrees to the left edge. Pixels are square, so the top edge is half as far.
        let (_, corner) = camera.ray(0.0, 0.0);
        assert!((corner / -corner.z - glam::DVec3::new(-1.0, 0.5, -1.0)).length() < 1e-12);
    }

    #[test]
    fn intrinsics_are_taken_from_the_file_and_rescaled() {
        let json = format!(
            r#"{{"w": 100, "h": 50, "fl_x": 80, "fl_y": 90, "cx": 40, "cy": 30,
                "frames": [{{{POSE}}}, {{"cx": 10, {POSE}}}]}}"#
        );
        let own = read(&json, None).unwrap();
        assert_eq!((own[0].width, own[0].height, own[0].center_x, own[1].center_x), (100, 50, 40.0, 10.0));
        let half = read(&json, Some((50, 100))).unwrap()[0];
        assert_eq!((half.focal_x, half.focal_y, half.center_x, half.center_y), (40.0, 180.0, 20.0, 60.0));
        // Rescaling maps a ray to the same point of the image.
        assert!((own[0].ray(70.0, 20.0).1 - half.ray(35.0, 40.0).1).length() < 1e-12);
    }

    /// Pixels are square unless the frame, or else the file, says otherwise.
    #[test]
    fn focal_lengths_of_different_lenses_are_not_mixed() {
        for (file, frame, (x, y)) in [
            (r#""fl_x": 100, "fl_y": 110"#, r#""fl_x": 80"#, (80.0, 80.0)),
            (r#""fl_x": 100, "fl_y": 110"#, r#""fl_y": 80"#, (80.0, 80.0)),
            (r#""fl_x": 100, "fl_y": 110"#, r#""cx": 50"#, (100.0, 110.0)),
            (r#""fl_y": 110"#, r#""fl_x": 80"#, (80.0, 110.0)),
            (r#""camera_angle_x": 2, "camera_angle_y": 2"#, r#""fl_x": 80"#, (80.0, 80.0)),
            (r#""fl_x": 100, "fl_y": 110"#, r#""camera_angle_x": 1.5707963267948966"#, (50.0, 50.0)),
            (r#""camera_angle_y": 1.5707963267948966"#, r#""cx": 50"#, (25.0, 25.0)),
        ] {
            let json = format!(r#"{{"w": 100, "h": 50, {file}, "frames": [{{{frame}, {POSE}}}]}}"#);
            let camera = read(&json, None).unwrap()[0];
            let off = glam::DVec2::new(camera.focal_x - x, camera.focal_y - y);
            assert!(off.length() < 1e-9, "{file}, {frame}: {camera:?}");
        }
    }

    /// A view shows the same at any size, also if the file does not say the size that its focal length is for.
    #[test]
    fn views_of_unknown_size_are_rescaled_too() {
        for (given, (width, height)) in [
            ("", (800.0, 800.0)),
            (r#""w": 100,"#, (100.0, 100.0)),
            (r#""h": 60,"#, (60.0, 60.0)),
            (r#""w": 100, "h": 50,"#, (100.0, 50.0)),
        ] {
            let json = format!(r#"{{{given} "fl_x": 90, "cx": 30, "frames": [{{{POSE}}}]}}"#);
            let own = read(&json, None).unwrap()[0];
            assert_eq!((f64::from(own.width), f64::from(own.height)), (width, height), "{given}");
            for size in [200, 400] {
                let resized = read(&json, Some((size, size))).unwrap()[0];
                assert_eq!((resized.width, resized.height), (size, size));
                let (x, y) = (f64::from(size) / width, f64::from(size) / height);
                let (ray, same) = (own.ray(7.0, 11.0).1, resized.ray(7.0 * x, 11.0 * y).1);
                assert!((ray - same).length() < 1e-12, "{given} {size}: {ray} {same}");
            }
        }
        // Of the missing sides, the caller knows the aspect ratio, and pixels stay square.
        for given in ["", r#""w": 100,"#, r#""h": 50,"#] {
            let wide =
                read(&format!(r#"{{{given} "fl_x": 90, "frames": [{{{POSE}}}]}}"#), Some((400, 200))).unwrap()[0];
            assert!((wide.focal_x - wide.focal_y).abs() < 1e-9, "{given}: {wide:?}");
            let width = if given.is_empty() { 800.0 } else { 100.0 };
            assert!((wide.focal_x - 90.0 * 400.0 / width).abs() < 1e-9, "{given}: {wide:?}");
        }
    }

    #[test]
    fn errors_name_the_invalid_key() {
        let pose = |matrix: &str| format!(r#"{{"fl_x": 1, "frames": [{{"transform_matrix": {matrix}}}]}}"#);
        for (json, key) in [
            ("{}", "frames"),
            (r#"{"frames": []}"#, "frames"),
            ("[", "transforms.json"),
            (&format!(r#"{{"frames": [{{{POSE}}}]}}"#), "camera_angle_x"),
            (&format!(r#"{{"camera_angle_x": 4.0, "frames": [{{{POSE}}}]}}"#), "camera_angle_x"),
            (&format!(r#"{{"camera_angle_x": 1e-320, "frames": [{{{POSE}}}]}}"#), "camera_angle_x"),
            (&format!(r#"{{"fl_x": -1, "frames": [{{{POSE}}}]}}"#), "fl_x"),
            (&format!(r#"{{"fl_x": 1, "fl_y": 1e-320, "frames": [{{{POSE}}}]}}"#), "fl_y"),
            (&format!(r#"{{"fl_x": 1, "cx": -1e300, "frames": [{{{POSE}}}]}}"#), "cx"),
            (&format!(r#"{{"fl_x": 1, "cy": 1e300, "frames": [{{{POSE}}}]}}"#), "cy"),
            (&format!(r#"{{"w": 1e9, "h": 3, "fl_x": 1, "frames": [{{{POSE}}}]}}"#), "w"),
            (&pose("[[1,2],[3,4]]"), "frames[0].transform_matrix"),
            (&pose("[[1,0,0,4],[0,1,0,5],[0,0,1],[0,0,0,1]]"), "[[1,0,0,4],[0,1,0,5],[0,0,1],[0,0,0,1]]"),
            (&pose("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]"), "frames[0].transform_matrix"),
            (&pose("[[1,0,0,1e39],[0,1,0,0],[0,0,1,0]]"), "frames[0].transform_matrix"),
            // Column by column.
            (&pose("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[4,5,6,1]]"), "a last row of [4,5,6,1]"),
            (&pose("[[1,0,0,4],[0,1,0,5],[0,0,1,\"6\"]]"), "frames[0].transform_matrix"),
            (&format!(r#"{{"fl_x": "wide", "frames": [{{{POSE}}}]}}"#), r#"fl_x: found "wide""#),
            (&format!(r#"{{"fl_x": 1, "frames": [{{{POSE}}}, {{"k2": [1], {POSE}}}]}}"#), "frames[1].k2: found [1]"),
            (&format!(r#"{{"fl_x": 1, "frames": [{{"file_path": 3, {POSE}}}]}}"#), "frames[0].file_path: found 3"),
            (&format!(r#"{{"fl_x": 1, "frames": {{{POSE}}}}}"#), "frames: found {"),
        ] {
            let message = read(json, None).unwrap_err().to_string();
            assert!(message.contains(key), "{json}: {message}");
        }
    }
}
