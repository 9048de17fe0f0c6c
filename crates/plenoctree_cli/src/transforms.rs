//! Writes pictures' cameras.

use std::path::{Path, PathBuf};

use glam::{DMat4, DQuat};
use plenoctree::camera::PinholeCamera;
use serde_json::json;

use crate::{files, result::Result};

/// Writes `transforms.json` to the folder of the pictures, whose names and cameras are given. `fov` is the cameras'
/// horizontal field of view in radians. Returns the file's path.
pub fn write(folder: &Path, fov: f64, pictures: &[(String, PinholeCamera)]) -> Result<PathBuf> {
    let frame = |(name, camera): &(String, PinholeCamera)| {
        let pose = DMat4::from_rotation_translation(DQuat::from_mat3(&camera.rotation), camera.position);
        json!({ "file_path": name, "transform_matrix": pose.transpose().to_cols_array_2d() })
    };
    let frames: Vec<_> = pictures.iter().map(frame).collect();
    let path = folder.join("transforms.json");
    let text = serde_json::to_string_pretty(&json!({ "camera_angle_x": fov, "frames": frames }))?;
    files::write_text(&path, &(text + "\n"))?;
    Ok(path)
}
