//! Rays from the pixels of a view into a field, computed in float64 so that shaders start from exact numbers.

use bevy::prelude::*;
use glam::{DAffine3, DMat3, DMat4, DVec2, DVec3, DVec4};
use plenoctree::{Frame, UpAxis};

use crate::{gpu::Level, prop::world_from_field, quality::PropQuality};

/// The rays of a view in a field's frame, as affine functions of the viewport point `reference + (x, y)`, in pixels:
/// `a[0] + x a[1] + y a[2]`. Rays begin at the box, so that numbers stay small no matter how far away the camera is.
pub(super) struct Rays {
    /// The viewport point from which x and y are measured, near the center of the box.
    pub reference: DVec2,
    /// The distance along the view axis at which rays begin, in world units of the scene.
    pub near: f64,
    /// The width in pixels of a finest cell, along its shortest side, where the box is nearest to the camera.
    pub cell_size: f64,
    /// The origins, in tree units.
    pub origin: [DVec3; 3],
    /// The directions, in world units of the field. Their length corresponds to one unit along the view axis.
    pub direction: [DVec3; 3],
    /// Transforms the unit cube to the box from `low` to `high`, in clip space.
    pub clip_from_box: DMat4,
    /// The lower corner of the box, in tree units. `high` is the upper corner.
    pub low: DVec3,
    pub high: DVec3,
    /// Whether the transform from the field to the view mirrors.
    pub mirrored: bool,
}

/// The pose of a field in the scene. `world_from_prop` is the entity's transform.
#[derive(Clone, Copy)]
pub(super) struct Pose {
    pub world_from_prop: GlobalTransform,
    pub up: UpAxis,
    pub frame: Frame,
    /// The lower corner of the box around the leaves, in tree units. `high` is the upper corner.
    pub low: DVec3,
    pub high: DVec3,
    /// The number of finest cells along a side of the tree's cube.
    pub cells: f64,
}

impl Pose {
    fn world_from_field(&self) -> DAffine3 {
        world_from_field(&self.world_from_prop, self.up)
    }

    /// Returns the transform from the unit cube to the box around the leaves, in the field's frame.
    fn field_from_box(&self) -> DAffine3 {
        let size = (self.high - self.low) / self.frame.scale;
        DAffine3::from_mat3_translation(DMat3::from_diagonal(size), self.frame.to_world(self.low))
    }

    /// Returns the transform from the scene to the unit cube, from the box around the leaves.
    #[cfg(feature = "shadows")]
    pub fn box_from_world(&self) -> DAffine3 {
        (self.world_from_field() * self.field_from_box()).inverse()
    }

    /// Returns how many finest cells are along a side of a cube that is as large as the box around the leaves.
    #[cfg(feature = "shadows")]
    pub fn cells_across(&self) -> f64 {
        (self.high - self.low).element_product().cbrt() * self.cells
    }

    /// Returns the level for a view in which a finest cell is `size` pixels wide: how many times that can be doubled
    /// without exceeding what `quality` wants.
    pub fn level(&self, size: f64, quality: &PropQuality) -> Level {
        // The casts turn less than 0 into 0.
        let coarser = (f64::from(quality.cell_size) / size).log2() as u32;
        Level::new(coarser.min(self.cells.log2() as u32), quality)
    }

    /// Returns the center of the box around the leaves, in the scene.
    pub fn center(&self) -> DVec3 {
        self.world_from_field().transform_point3(self.frame.to_world(0.5 * (self.low + self.high)))
    }

    /// Returns the rays of a camera, or `None` if the prop has no volume or is nowhere: if a transform is degenerate or
    /// not finite.
    pub fn rays(&self, world_from_view: &GlobalTransform, clip_from_view: Mat4, viewport: UVec2) -> Option<Rays> {
        // The near plane of an orthographic camera may be behind it.
        let least = if is_orthographic(clip_from_view) { f64::NEG_INFINITY } else { 0.0 };
        // Rays cannot begin at an oblique plane.
        let is_oblique = clip_from_view.row(2).xy() != Vec2::ZERO;
        let begin = if is_oblique { least } else { near_plane(clip_from_view).max(least) };
        self.rays_from(begin, world_from_view.affine().as_daffine3(), clip_from_view, viewport)
    }

    /// Returns rays that begin at a distance along the view axis, or where the prop does.
    pub fn rays_from(
        &self,
        begin: f64,
        world_from_view: DAffine3,
        clip_from_view: Mat4,
        viewport: UVec2,
    ) -> Option<Rays> {
        let orthographic = is_orthographic(clip_from_view);
        let world_from_field = self.world_from_field();
        let determinant = world_from_field.matrix3.determinant();
        if !determinant.is_normal() {
            return None;
        }
        let field_from_view = world_from_field.inverse() * world_from_view;
        let clip_from_view = clip_from_view.as_dmat4();
        let view_from_clip = clip_from_view.inverse();

        let view_from_box = world_from_view.inverse() * world_from_field * self.field_from_box();
        let clip_from_box = clip_from_view * DMat4::from(view_from_box);
        if !clip_from_box.is_finite() {
            return None;
        }
        let size = viewport.as_dvec2();
        let near = corners(view_from_box.into()).map(|corner| -corner.z).fold(f64::INFINITY, f64::min).max(begin);
        let middle = clip_from_box * DVec4::new(0.5, 0.5, 0.5, 1.0);
        let reference =
            if middle.w > 0.0 { 0.5 * (1.0 + DVec2::new(middle.x, -middle.y) / middle.w) * size } else { 0.5 * size };
        // Props that are far out of view do not need exact rays.
        let reference = reference.clamp(-size, 2.0 * size).round();

        // Three points of the viewport determine an affine function.
        let at = |x: f64, y: f64| {
            let ndc = DVec4::new(2.0 * x / size.x - 1.0, 1.0 - 2.0 * y / size.y, 1.0, 1.0);
            let seen = view_from_clip * ndc;
            let seen = seen.truncate() / seen.w;
            let (origin, direction) = if orthographic {
                // Temporal jitter shears the projection.
                let along = view_from_clip.z_axis.truncate() / -view_from_clip.z_axis.z;
                (seen + seen.z * along, along)
            } else {
                (DVec3::ZERO, seen / -seen.z)
            };
            let origin = origin + near * direction;
            (self.frame.to_tree(field_from_view.transform_point3(origin)), field_from_view.transform_vector3(direction))
        };
        let base = at(reference.x, reference.y);
        let (right, down) = (at(reference.x + size.x, reference.y), at(reference.x, reference.y + size.y));
        let slopes = |base: DVec3, right: DVec3, down: DVec3| [base, (right - base) / size.x, (down - base) / size.y];
        // The number of pixels that one unit of view space spans, at distance one or, with parallel rays, at any
        // distance.
        let focal = 0.5 * size * DVec2::new(clip_from_view.x_axis.x, clip_from_view.y_axis.y).abs();
        let pixels = focal.max_element() / if orthographic { 1.0 } else { near };
        // As seen on the screen.
        let [x, y] = [clip_from_view.x_axis, clip_from_view.y_axis];
        let is_flipped = x.x * y.y < x.y * y.x;
        let axes = view_from_box.matrix3 * DMat3::from_diagonal((self.high - self.low).recip());
        let unit = axes.x_axis.length().min(axes.y_axis.length()).min(axes.z_axis.length());
        Some(Rays {
            reference,
            near,
            cell_size: pixels * unit / self.cells,
            origin: slopes(base.0, right.0, down.0),
            direction: slopes(base.1, right.1, down.1),
            clip_from_box,
            low: self.low,
            high: self.high,
            mirrored: (determinant < 0.0) ^ (world_from_view.matrix3.determinant() < 0.0) ^ is_flipped,
        })
    }
}

pub(super) fn is_orthographic(clip_from_view: Mat4) -> bool {
    clip_from_view.w_axis.w == 1.0
}

/// Returns the distance along the view axis at which the depth is 1.
pub(super) fn near_plane(clip_from_view: Mat4) -> f64 {
    let [z, w] = [clip_from_view.z_axis, clip_from_view.w_axis].map(|column| column.as_dvec4());
    (w.z - w.w) / (z.z - z.w)
}

/// Returns the coefficients by which shaders turn distances along the view axis into depths, and back.
pub(super) fn depth_from_distance(clip_from_view: Mat4) -> Vec4 {
    let [z, w] = [clip_from_view.z_axis, clip_from_view.w_axis];
    Vec4::new(z.z, w.z, z.w, w.w)
}

/// Returns the rectangle of pixels that the unit cube can cover.
pub(super) fn covered(clip_from_box: DMat4, size: UVec2) -> URect {
    let whole = URect::from_corners(UVec2::ZERO, size);
    match extent(clip_from_box, size) {
        // The casts saturate.
        Some([low, high]) => whole.intersect(URect::from_corners(low.as_uvec2(), high.as_uvec2())),
        // Not all props behind the camera are culled.
        None if corners(clip_from_box).all(|corner| corner.w <= 0.0) => URect::default(),
        None => whole,
    }
}

/// Returns the corners of the unit cube in another space.
fn corners(from_box: DMat4) -> impl Iterator<Item = DVec4> {
    let corner = |index: u32| UVec3::new(index & 1, index >> 1 & 1, index >> 2).as_dvec3();
    (0..8).map(move |index| from_box * corner(index).extend(1.0))
}

/// Returns the corners of the pixels that the unit cube can cover, which may be out of view, or `None` if a part of the
/// cube is behind the camera.
pub(super) fn extent(clip_from_box: DMat4, size: UVec2) -> Option<[DVec2; 2]> {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for clip in corners(clip_from_box) {
        if clip.w <= 0.0 {
            return None;
        }
        let ndc = DVec2::new(clip.x, -clip.y) / clip.w;
        let point = 0.5 * (ndc + 1.0) * size.as_dvec2();
        (low, high) = (low.min(point), high.max(point));
    }
    Some([low.floor(), high.ceil()])
}

#[cfg(test)]
mod tests {
    use plenoctree::camera::PinholeCamera;
    use proptest::prelude::*;

    use super::*;

    /// Returns the pose of a field whose leaves fill its cube.
    fn pose(world_from_prop: GlobalTransform, up: UpAxis, frame: Frame) -> Pose {
        Pose { world_from_prop, up, frame, low: DVec3::ZERO, high: DVec3::ONE, cells: 256.0 }
    }

    /// The rays of a Bevy camera into a rotated, scaled and translated field are those of the same pinhole camera.
    #[test]
    fn rays_agree_with_a_pinhole_camera() {
        let frame = Frame::spanning(DVec3::new(-1.0, -2.0, -3.0), DVec3::new(2.0, 2.0, 1.0));
        let pose = pose(GlobalTransform::IDENTITY, UpAxis::Z, frame);
        let viewport = UVec2::new(320, 200);
        let fov_x = 0.8_f64;
        let pinhole = PinholeCamera::new(viewport.x, viewport.y, fov_x, DMat4::IDENTITY).looking_at(
            DVec3::new(4.0, -3.0, 2.0),
            DVec3::ZERO,
            DVec3::Z,
        );
        let fov_y = 2.0 * ((0.5 * fov_x).tan() * 200.0 / 320.0).atan();
        let projection = Mat4::perspective_infinite_reverse_rh(fov_y as f32, 1.6, 0.1);
        // Bevy's world is the field's, rotated to y up.
        let turn = UpAxis::Z.to_y_up();
        let view = GlobalTransform::from(bevy::math::Affine3A::from_mat3_translation(
            (turn * pinhole.rotation).as_mat3(),
            (turn * pinhole.position).as_vec3(),
        ));
        let rays = pose.rays(&view, projection, viewport).unwrap();
        for (x, y) in [(0.5, 0.5), (160.0, 100.0), (319.5, 42.5)] {
            let (origin, direction) = pinhole.ray(x, y);
            let of = |a: [DVec3; 3]| a[0] + (x - rays.reference.x) * a[1] + (y - rays.reference.y) * a[2];
            let toward = of(rays.direction);
            assert!((toward.normalize() - direction).length() < 1e-6);
            let begins = frame.to_tree(origin + rays.near * toward.length() * direction);
            assert!((of(rays.origin) - begins).length() < 1e-6);
        }
    }

    #[test]
    fn props_without_a_volume_or_a_place_have_no_rays() {
        let has_rays = |prop: Transform, view: Transform, fov: f32| {
            let pose = pose(prop.into(), UpAxis::Y, Frame::spanning(DVec3::ZERO, DVec3::ONE));
            let projection = Mat4::perspective_infinite_reverse_rh(fov, 1.0, 0.1);
            pose.rays(&view.into(), projection, UVec2::splat(8)).is_some()
        };
        let (here, nowhere) = (Transform::IDENTITY, Transform::from_xyz(f32::NAN, 0.0, 0.0));
        assert!(has_rays(here, here, 1.0));
        let flat = Transform::from_scale(Vec3::new(1.0, 0.0, 1.0));
        for prop in [flat, nowhere, Transform::from_xyz(0.0, f32::INFINITY, 0.0)] {
            assert!(!has_rays(prop, here, 1.0), "{prop:?}");
        }
        assert!(!has_rays(here, nowhere, 1.0));
        assert!(!has_rays(here, here, f32::NAN));
    }

    /// Props behind the camera cover nothing, even if they are not culled.
    #[test]
    fn boxes_behind_the_camera_cover_nothing() {
        let projection = DMat4::perspective_infinite_reverse_rh(1.0, 1.0, 0.1);
        let at = |z: f64| covered(projection * DMat4::from_translation(DVec3::new(-0.5, -0.5, z)), UVec2::splat(64));
        assert!(at(2.0).is_empty());
        assert_eq!(at(-0.5), URect::new(0, 0, 64, 64));
        assert!(!at(-9.0).is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Holds even if corners of the box are behind the camera.
        #[test]
        fn what_is_seen_of_a_box_is_covered(
            eye in prop::array::uniform3(-1.0..2.0f64),
            target in prop::array::uniform3(-0.5..1.5f64),
            point in prop::array::uniform3(0.0..=1.0f64),
            size_of_box in prop::array::uniform3(0.01..1.0f64),
        ) {
            let (eye, target, size) = (DVec3::from(eye), DVec3::from(target), UVec2::new(1600, 1200));
            prop_assume!((target - eye).length() > 0.01);
            let view = DMat4::look_at_rh(eye, target, DVec3::new(0.1, 1.0, 0.2).normalize());
            let clip_from_box = DMat4::perspective_infinite_reverse_rh(1.0, 4.0 / 3.0, 0.01)
                * view
                * DMat4::from_scale(size_of_box.into());
            let clip = clip_from_box * DVec3::from(point).extend(1.0);
            let ndc = DVec2::new(clip.x, -clip.y) / clip.w;
            if clip.w > 0.0 && ndc.abs().max_element() < 1.0 {
                let pixel = (0.5 * (ndc + 1.0) * size.as_dvec2()).as_uvec2();
                let rect = covered(clip_from_box, size);
                // A point between two pixels belongs to both.
                let (low, high) = (rect.min.saturating_sub(UVec2::ONE), rect.max + 1);
                prop_assert!(pixel.cmpge(low).all() && pixel.cmplt(high).all(), "{pixel} in {rect:?}");
            }
        }
    }
}
