//! Writes and reads pictures' cameras.

use std::{
    path::{Path, PathBuf},
    sync::Once,
};

use glam::{DMat4, DQuat};
use plenoctree::camera::PinholeCamera;
use plenoctree_fit::Transforms;
use serde_json::json;

use crate::{console, files, result::Result};

/// The name of the file that [`write()`] writes.
pub const FILE: &str = "transforms.json";

/// Reads cameras, for images of this size if it is given. Warns, once, of lenses that distort: views do not.
pub fn read(path: &Path, size: Option<(u32, u32)>) -> Result<Transforms> {
    static WARNED: Once = Once::new();
    let transforms = Transforms::read(path, size)?;
    if transforms.is_distorted {
        WARNED.call_once(|| {
            let path = path.display();
            console::complain!("warning: {path}: lenses distort, but views are rendered without distortion");
        });
    }
    Ok(transforms)
}

/// Writes `transforms.json` to the folder of the pictures, whose names and cameras are given. `fov` is the cameras'
/// horizontal field of view in radians. Returns the file's path.
pub fn write(folder: &Path, fov: f64, pictures: &[(String, PinholeCamera)]) -> Result<PathBuf> {
    let frame = |(name, camera): &(String, PinholeCamera)| {
        let pose = DMat4::from_rotation_translation(DQuat::from_mat3(&camera.rotation), camera.position);
        json!({ "file_path": name, "transform_matrix": pose.transpose().to_cols_array_2d() })
    };
    let frames: Vec<_> = pictures.iter().map(frame).collect();
    let path = folder.join(FILE);
    let text = serde_json::to_string_pretty(&json!({ "camera_angle_x": fov, "frames": frames }))?;
    files::write_text(&path, &(text + "\n"))?;
    Ok(path)
}
