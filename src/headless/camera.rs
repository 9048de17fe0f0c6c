//! Cameras for captures: pinhole cameras as Bevy cameras, and a camera with exact colors.

use bevy::{
    camera::{CameraProjection, SubCameraView},
    core_pipeline::tonemapping::{DebandDither, Tonemapping},
    math::{Affine3A, Vec3A, Vec4},
    prelude::*,
};
use plenoctree::{UpAxis, camera::PinholeCamera};

/// The projection of a [`PinholeCamera`], which may be off-center, with an infinite far plane.
#[derive(Clone, Copy, Debug)]
struct PinholeProjection(PinholeCamera);

/// The distance of the near plane, as a share of the camera's distance from the origin: little more than the steps of
/// its coordinates in float32. At the origin, it is in world units.
const NEAR: f64 = 2e-7;

impl CameraProjection for PinholeProjection {
    fn get_clip_from_view(&self) -> Mat4 {
        let camera = &self.0;
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let distance = camera.position.length();
        let near = NEAR * if distance > 0.0 { distance } else { 1.0 };
        // The image's y axis points down, that of clip space up.
        glam::DMat4::from_cols(
            glam::DVec4::X * (2.0 * camera.focal_x / width),
            glam::DVec4::Y * (2.0 * camera.focal_y / height),
            glam::DVec4::new(1.0 - 2.0 * camera.center_x / width, 2.0 * camera.center_y / height - 1.0, 0.0, -1.0),
            glam::DVec4::Z * near,
        )
        .as_mat4()
    }

    fn get_clip_from_view_for_sub(&self, sub: &SubCameraView) -> Mat4 {
        // How many times the part fits into the full view, and the part's center in the clip space of the full view.
        let (full, size) = (sub.full_size.as_vec2(), sub.size.as_vec2());
        let middle = 2.0 * (sub.offset + 0.5 * size) / full - 1.0;
        let scale = full / size;
        let clip_from_full = Mat4::from_cols(
            Vec4::X * scale.x,
            Vec4::Y * scale.y,
            Vec4::Z,
            // Offsets count downward.
            Vec4::new(-middle.x * scale.x, middle.y * scale.y, 0.0, 1.0),
        );
        clip_from_full * self.get_clip_from_view()
    }

    fn update(&mut self, _: f32, _: f32) {}

    fn far(&self) -> f32 {
        f32::INFINITY
    }

    // The arguments are coordinates: they are negative in front of the camera.
    fn get_frustum_corners(&self, z_near: f32, z_far: f32) -> [Vec3A; 8] {
        let view_from_clip = self.get_clip_from_view().inverse();
        let corners = [(1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
        std::array::from_fn(|index| {
            let (x, y) = corners[index % 4];
            let point = view_from_clip * Vec4::new(x, y, 1.0, 1.0);
            let z = if index < 4 { z_near } else { z_far };
            Vec3A::from(point.truncate() / point.z * z)
        })
    }
}

/// Converts a pinhole camera to components for an entity with a `Camera3d`.
///
/// The pinhole camera is in the frame of a field whose up axis is `up`. The Bevy camera sees a prop of that field with
/// the identity transform exactly as the pinhole camera sees the field.
pub fn pinhole_view(camera: &PinholeCamera, up: UpAxis) -> (Projection, Transform) {
    let to_y_up = up.to_y_up();
    let (rotation, position) = (to_y_up * camera.rotation, to_y_up * camera.position);
    let affine = Affine3A::from_mat3_translation(rotation.as_mat3(), position.as_vec3());
    (Projection::custom(PinholeProjection(*camera)), Transform::from_matrix(affine.into()))
}

/// Returns a bundle for a camera that captures exact colors over `background`: one sample per pixel, without
/// tonemapping or dithering. It contains a `Camera` and a `Camera3d`.
pub fn exact_camera(background: Color) -> impl Bundle {
    (
        Camera3d::default(),
        Camera { clear_color: background.into(), ..default() },
        Msaa::Off,
        Tonemapping::None,
        DebandDither::Disabled,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat4, DVec3};

    /// A point in the scene is projected to the pixel whose ray passes through it.
    #[test]
    fn projects_onto_the_pixel_of_the_ray() {
        let mut camera = PinholeCamera::new(400, 300, 1.0, DMat4::IDENTITY).looking_at(
            DVec3::new(3.0, 1.0, 2.0),
            DVec3::ZERO,
            DVec3::Z,
        );
        (camera.center_x, camera.center_y, camera.focal_y) = (150.0, 170.0, 300.0);
        let (projection, transform) = pinhole_view(&camera, UpAxis::Z);
        let Projection::Custom(projection) = projection else { panic!("not a custom projection") };
        let view_from_world = transform.to_matrix().inverse();
        let clip_from_world = projection.get_clip_from_view() * view_from_world;
        for (x, y) in [(0.0, 0.0), (150.0, 170.0), (399.0, 20.0)] {
            let (origin, direction) = camera.ray(x, y);
            let point = UpAxis::Z.to_y_up() * (origin + 2.5 * direction);
            let ndc = clip_from_world.project_point3(point.as_vec3());
            assert!((200.0 * (1.0 + ndc.x) - x as f32).abs() < 1e-2, "{ndc} for {x}, {y}");
            assert!((150.0 * (1.0 - ndc.y) - y as f32).abs() < 1e-2, "{ndc} for {x}, {y}");
            // A part of the view shows the same pixels, counted from its own corner. It has its own units.
            for unit in [1, 3] {
                let (offset, size) = (UVec2::new(100, 20), UVec2::new(200, 250));
                let full_size = UVec2::new(400, 300) * unit;
                let sub = SubCameraView { full_size, offset: (offset * unit).as_vec2(), size: size * unit };
                let clip_from_view = projection.get_clip_from_view_for_sub(&sub);
                let ndc = (clip_from_view * view_from_world).project_point3(point.as_vec3());
                let pixel = Vec2::new(1.0 + ndc.x, 1.0 - ndc.y) * 0.5 * size.as_vec2() + offset.as_vec2();
                assert!(pixel.distance(Vec2::new(x as f32, y as f32)) < 2e-2, "{pixel} for {x}, {y}");
            }
        }
    }
}
