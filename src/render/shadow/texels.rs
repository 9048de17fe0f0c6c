//! Where the texels of a shadow map are, and which of them a prop can cover.

use bevy::{
    prelude::*,
    render::{renderer::RenderDevice, view::ExtractedView},
};
use glam::{DAffine3, DMat4, DVec2, DVec4};

use crate::render::rays::{Pose, Rays, covered, extent, is_orthographic, near_plane};

/// How the light of a shadow map sees a prop.
///
/// Bevy moves the maps of a directional light by whole texels when the camera moves, so that shadows do not crawl. The
/// texels around a prop are counted from one near its center, regardless of where the map is. The rays through them
/// stay the same, bit for bit, while the light and the prop are at rest.
pub(super) struct LightView {
    pub rays: Rays,
    /// The distance along the map's axis at which rays begin.
    pub near: f64,
    /// The offset from a texel to its place in the map.
    pub shift: IVec2,
    /// The texels that the box around the leaves can cover.
    texels: IRect,
    size: UVec2,
}

/// The width of the blocks that are marched, in texels. Mesa's software rasterizer loses texels of blocks that are
/// drawn only partly, such as those along the edges of triangles.
const BLOCK: u32 = 8;

/// Counts of texels are limited, so that sums do not overflow.
const FAR: f64 = 1e8;

/// Returns the size of a shadow map: what the app asks for, or the most that the GPU can have, as in Bevy.
pub(super) fn map_size(view: &ExtractedView, device: &RenderDevice) -> UVec2 {
    view.viewport.zw().min(UVec2::splat(device.limits().max_texture_dimension_2d))
}

impl LightView {
    /// Returns `None` if the prop has no volume.
    pub fn new(pose: &Pose, view: &ExtractedView, size: UVec2) -> Option<Self> {
        let world_from_view = view.world_from_view.affine().as_daffine3();
        match view.clip_from_world {
            Some(clip_from_world) if is_orthographic(view.clip_from_view) => {
                Self::parallel(pose, world_from_view, view.clip_from_view, clip_from_world, size)
            }
            _ => Self::perspective(pose, world_from_view, view.clip_from_view, size),
        }
    }

    /// Nothing nearer than the near plane casts a shadow: it may be the lamp's own housing.
    fn perspective(pose: &Pose, world_from_view: DAffine3, clip_from_view: Mat4, size: UVec2) -> Option<Self> {
        let rays = pose.rays_from(near_plane(clip_from_view), world_from_view, clip_from_view, size)?;
        let texels = covered(rays.clip_from_box, size).as_irect();
        Some(Self { near: rays.near, rays, shift: IVec2::ZERO, texels, size })
    }

    /// Props nearer than the near plane cast shadows nevertheless, because the sun is farther away.
    fn parallel(
        pose: &Pose,
        world_from_view: DAffine3,
        clip_from_view: Mat4,
        clip_from_world: Mat4,
        size: UVec2,
    ) -> Option<Self> {
        let (clip_from_view, clip_from_world) = (clip_from_view.as_dmat4(), clip_from_world.as_dmat4());
        let half = 0.5 * size.as_dvec2();
        let texels_per_unit = DVec2::new(clip_from_view.x_axis.x, clip_from_view.y_axis.y) * half;
        // The center of the map, in texels from the origin of the scene, and where its axis begins.
        let center = (-half * clip_from_world.w_axis.truncate().truncate()).round();
        let begin = (clip_from_view.w_axis.z - clip_from_world.w_axis.z) / clip_from_view.z_axis.z;
        // The texel from which others are counted.
        let rotation = world_from_view.matrix3;
        let anchor = (rotation.transpose() * pose.center()).truncate() * texels_per_unit;
        let anchor = anchor.round();
        let world_from_view =
            DAffine3::from_mat3_translation(rotation, rotation * (anchor / texels_per_unit).extend(0.0));
        // The length of the map's axis changes with the camera.
        let clip_from_view = DMat4::from_cols(
            DVec4::new(clip_from_view.x_axis.x, 0.0, 0.0, 0.0),
            DVec4::new(0.0, clip_from_view.y_axis.y, 0.0, 0.0),
            DVec4::Z,
            DVec4::new(0.0, 0.0, 1.0, 1.0),
        );
        let rays = pose.rays_from(f64::NEG_INFINITY, world_from_view, clip_from_view.as_mat4(), size)?;
        let limited = |texels: DVec2| texels.clamp(DVec2::splat(-FAR), DVec2::splat(FAR)).as_ivec2();
        let [low, high] = extent(rays.clip_from_box, size)?.map(limited);
        let shift = limited((anchor - center) * DVec2::new(1.0, -1.0));
        Some(Self { near: rays.near + begin, rays, shift, texels: IRect { min: low, max: high }, size })
    }

    /// Returns the texels of the map that the prop can cover.
    pub fn on_map(&self) -> URect {
        let limited = |texel: IVec2| (texel + self.shift).clamp(IVec2::ZERO, self.size.as_ivec2()).as_uvec2();
        URect { min: limited(self.texels.min), max: limited(self.texels.max) }
    }

    /// Returns the texels of the map to march, in whole blocks.
    pub fn to_march(&self) -> URect {
        let URect { min, max } = self.on_map();
        let blocks = |texels: UVec2| (texels + BLOCK - 1) / BLOCK * BLOCK;
        URect { min: min / BLOCK * BLOCK, max: blocks(max).min(self.size) }
    }

    /// Returns the texels to keep: all that the prop can cover if they are not more than a map has in either direction,
    /// so that none is missing when the map moves. Otherwise, those on the map. The quarters of a tile are whole
    /// blocks.
    pub fn to_cache(&self) -> IRect {
        let texels = if self.texels.size().cmple(self.size.as_ivec2()).all() {
            self.texels
        } else {
            let on_map = self.on_map().as_irect();
            IRect { min: on_map.min - self.shift, max: on_map.max - self.shift }
        };
        let quarter = 2 * BLOCK as i32;
        IRect { max: texels.min + (texels.size() + quarter - 1) / quarter * quarter, ..texels }
    }
}

/// Returns the parts of a rectangle in the quarters of a texture.
pub(super) fn parts(rect: URect, size: UVec2) -> impl Iterator<Item = URect> {
    let middle = size / 2;
    let quarter = move |corner: u32| {
        let low = middle * UVec2::new(corner & 1, corner >> 1);
        URect { min: low, max: UVec2::select(low.cmpgt(UVec2::ZERO), size, middle) }
    };
    (0..4).map(quarter).map(move |quarter| rect.intersect(quarter)).filter(|part| !part.is_empty())
}

/// Returns the transform from the unit square to a part of a texture. The square begins at the part's outer corner, so
/// that twice its size is still within the texture: the triangle of the pass need not be clipped, which would split it
/// in the middle of blocks.
pub(super) fn clip_from_part(part: URect, size: UVec2) -> Mat4 {
    let clip = |point: UVec2| (2.0 * point.as_dvec2() / size.as_dvec2() - 1.0) * DVec2::new(1.0, -1.0);
    let (low, high) = (clip(part.min), clip(part.max));
    let begin = DVec2::select(low.abs().cmpge(high.abs()), low, high);
    let extent = low + high - 2.0 * begin;
    (DMat4::from_translation(begin.extend(0.0)) * DMat4::from_scale(extent.extend(1.0))).as_mat4()
}
