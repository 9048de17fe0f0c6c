//! Writes pictures' cameras, and finds the pictures of cameras.

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::{DMat4, DQuat};
use plenoctree::camera::PinholeCamera;
use serde_json::{Value, json};

use crate::{files, result::Result};

/// Returns the pictures that a camera file may list: as it names them, and with the extension that some leave out.
pub fn pictures(cameras: &Path) -> Vec<PathBuf> {
    let json: Value = fs::read(cameras).ok().and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
    let frames = json["frames"].as_array().into_iter().flatten();
    let names = frames.filter_map(|frame| frame["file_path"].as_str());
    names.flat_map(|name| [name.to_string(), format!("{name}.png")]).map(|name| cameras.with_file_name(name)).collect()
}

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
