//! Checks for the camera file reader.

use arbitrary::Arbitrary;
use glam::{DMat3, DQuat, DVec3};
use plenoctree::camera::PinholeCamera;
use plenoctree_fit::read_transforms;

use crate::{message::check_message, scratch::Scratch};

/// The content of a camera file, and the requested frame size.
#[derive(Arbitrary, Debug)]
pub struct TransformsFile<'a> {
    size: Option<(u16, u16)>,
    content: Content<'a>,
}

#[derive(Arbitrary, Debug)]
enum Content<'a> {
    Text(&'a [u8]),
    Cameras(Intrinsics, Vec<(Intrinsics, Pose)>),
}

#[derive(Arbitrary, Debug)]
struct Intrinsics([Option<Number>; KEYS.len()]);

const KEYS: [&str; 8] = ["camera_angle_x", "w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_y"];

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Number {
    Whole(i16),
    Part(i16),
    Any(f64),
}

#[derive(Arbitrary, Debug)]
enum Pose {
    Rotation([i8; 4], Number, [Number; 3]),
    Matrix(Vec<Vec<f64>>),
}

impl Number {
    fn value(self) -> f64 {
        match self {
            Self::Whole(number) => number.into(),
            Self::Part(number) => f64::from(number) / 4096.0,
            Self::Any(number) => number,
        }
    }
}

impl Intrinsics {
    fn text(&self) -> String {
        let given = KEYS.iter().zip(&self.0).filter_map(|(key, number)| Some((key, number.as_ref()?)));
        given.map(|(key, number)| format!("\"{key}\": {:?}, ", number.value())).collect()
    }
}

impl Pose {
    fn rows(&self) -> Vec<Vec<f64>> {
        match self {
            Self::Matrix(rows) => rows.clone(),
            Self::Rotation(turn, scale, place) => {
                let [x, y, z, w] = turn.map(f64::from);
                let length = (x * x + y * y + z * z + w * w).sqrt().max(1.0);
                let turn = DQuat::from_xyzw(x / length, y / length, z / length, w / length);
                let axes = DMat3::from_quat(turn) * scale.value();
                let row = |i: usize| [&axes.row(i).to_array()[..], &[place[i].value()]].concat();
                vec![row(0), row(1), row(2), vec![0.0, 0.0, 0.0, 1.0]]
            }
        }
    }
}

impl TransformsFile<'_> {
    pub fn text(&self) -> Vec<u8> {
        match &self.content {
            Content::Text(text) => text.to_vec(),
            Content::Cameras(shared, frames) => {
                let frame = |(own, pose): &(Intrinsics, Pose)| {
                    format!("{{{}\"transform_matrix\": {:?}}}", own.text(), pose.rows())
                };
                let frames: Vec<String> = frames.iter().map(frame).collect();
                format!("{{{}\"frames\": [{}]}}", shared.text(), frames.join(", ")).into_bytes()
            }
        }
    }

    /// Returns the requested frame size, within the valid range.
    pub fn size(&self) -> Option<(u32, u32)> {
        let side = |side: u16| u32::from(side % 16384) + 1;
        self.size.map(|(width, height)| (side(width), side(height)))
    }
}

/// Checks that a file gives valid cameras or a valid error message.
pub fn check_transforms(text: &[u8], size: Option<(u32, u32)>) {
    let folder = Scratch::new("transforms");
    let file = folder.file("transforms.json", text);
    match read_transforms(&file, size) {
        Ok(cameras) => {
            assert!(!cameras.is_empty());
            cameras.iter().for_each(|camera| check_camera(camera, size));
        }
        Err(error) => check_message(&error, text.len()),
    }
}

fn check_camera(camera: &PinholeCamera, size: Option<(u32, u32)>) {
    let PinholeCamera { width, height, rotation, .. } = *camera;
    assert!(size.is_none_or(|size| size == (width, height)), "{camera:?}");
    assert!((1..=16384).contains(&width) && (1..=16384).contains(&height), "{camera:?}");
    let skew = rotation * rotation.transpose() - DMat3::IDENTITY;
    assert!(skew.to_cols_array().iter().all(|x| x.abs() < 0.02), "{camera:?}");
    let (right, bottom) = (f64::from(width), f64::from(height));
    for (x, y) in [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom), (0.5 * right, 0.5 * bottom)] {
        let (origin, direction): (DVec3, DVec3) = camera.ray(x, y);
        assert!(
            origin.as_vec3().is_finite() && direction.is_normalized(),
            "from {origin} along {direction}: {camera:?}"
        );
    }
}
