//! Marches rays through the octree, cell by cell and in float64: section 2 of the method.

use std::ops::ControlFlow;

use glam::{DVec3, I64Vec3};

use crate::field::{NodePath, PlenOctree};

/// Transmittance below which a march stops and the ray counts as opaque.
const STOP_TRANSMITTANCE: f64 = 1e-2;

/// A leaf that a ray crosses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Index of the leaf.
    pub leaf: u32,
    /// Distance from the ray's origin to the point where it enters the leaf, in multiples of the direction's length.
    pub start: f64,
    /// Length of the ray's path inside the leaf, in multiples of the direction's length: world units of the field if
    /// the direction is a unit vector.
    pub length: f64,
}

impl PlenOctree {
    /// Calls `visit` for every leaf that the ray `origin + t direction`, t >= 0, crosses, in order. Stops when `visit`
    /// returns [`ControlFlow::Break`].
    ///
    /// `origin` and `direction` are in the field's frame. `direction` does not have to be a unit vector.
    ///
    /// Positions are counted in whole cells: each step leaves a cell through one of its faces and enters the neighbor
    /// on the other side. No cell is skipped or visited twice, however small it is, and the lengths add up to the path
    /// through the tree's cube.
    pub fn march(&self, origin: DVec3, direction: DVec3, visit: impl FnMut(Crossing) -> ControlFlow<()>) {
        let cells = f64::from(1u32 << self.depth());
        let frame = self.frame();
        self.march_cells(frame.to_tree(origin) * cells, direction * frame.scale * cells, visit);
    }

    /// Marches like [`Self::march`]. `origin` and `direction` are in finest cells.
    pub(crate) fn march_cells(
        &self,
        origin: DVec3,
        direction: DVec3,
        mut visit: impl FnMut(Crossing) -> ControlFlow<()>,
    ) {
        let cells = f64::from(1u32 << self.depth());
        let (mut t, mut end) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            if direction[axis] != 0.0 {
                let a = -origin[axis] / direction[axis];
                let b = (cells - origin[axis]) / direction[axis];
                t = t.max(a.min(b));
                end = end.min(a.max(b));
            } else if !(0.0..=cells).contains(&origin[axis]) {
                return;
            }
        }
        if t >= end {
            return;
        }

        let last = I64Vec3::splat((1i64 << self.depth()) - 1);
        // Casts round toward 0, not down, but that only matters below 0, which is clamped.
        let mut position = (origin + t * direction).as_i64vec3().clamp(I64Vec3::ZERO, last);
        // Neighbors are found from the smallest node around both.
        let (mut path, mut level) = (NodePath::default(), self.depth());
        loop {
            let (cell, corner, size) = self.locate_below(&mut path, level, position.as_uvec3());
            let low = corner.as_i64vec3();
            let high = low + i64::from(size);

            // The face through which the ray leaves.
            let (mut exit, mut through) = (f64::INFINITY, 0);
            for axis in 0..3 {
                let plane = if direction[axis] > 0.0 { high[axis] } else { low[axis] } as f64;
                if direction[axis] != 0.0 && (plane - origin[axis]) / direction[axis] < exit {
                    exit = (plane - origin[axis]) / direction[axis];
                    through = axis;
                }
            }
            let exit = exit.max(t);
            if !exit.is_finite() {
                return;
            }
            if let Some(leaf) = cell.as_leaf()
                && visit(Crossing { leaf, start: t, length: exit - t }).is_break()
            {
                return;
            }
            t = exit;
            let mut next = (origin + t * direction).as_i64vec3().clamp(low, high - 1);
            next[through] = if direction[through] > 0.0 { high[through] } else { low[through] - 1 };
            if next[through] < 0 || next[through] > last[through] {
                return;
            }
            let differing = (position ^ next).as_uvec3();
            level = u32::BITS - (differing.x | differing.y | differing.z).leading_zeros();
            position = next;
        }
    }

    /// Returns the color `C` and the opacity `A` along a ray in the field's frame: section 2 of the method.
    ///
    /// `direction` is a unit vector. The color is encoded sRGB, premultiplied by the opacity, which is 0 to 1. Once the
    /// transmittance falls below 1e-2, the march stops and the opacity is 1.
    pub fn render_ray(&self, origin: DVec3, direction: DVec3) -> (DVec3, f64) {
        self.render_ray_visiting(origin, direction, |_, _| ())
    }

    /// Renders a ray like [`Self::render_ray`], and calls `visit` with every crossing and the density there.
    pub(crate) fn render_ray_visiting(
        &self,
        origin: DVec3,
        direction: DVec3,
        mut visit: impl FnMut(Crossing, f64),
    ) -> (DVec3, f64) {
        let y = self.basis().evaluate(direction);
        // The sum of the weights is 1 - transmittance, but without cancellation in thin fields.
        let (mut color, mut transmittance, mut sum) = (DVec3::ZERO, 1.0, 0.0);
        self.march(origin, direction, |crossing| {
            let density = f64::from(self.densities()[crossing.leaf as usize]);
            visit(crossing, density);
            let opacity = -(-density * crossing.length).exp_m1();
            let weight = transmittance * opacity;
            sum += weight;
            color += weight * self.radiance_with(crossing.leaf, &y);
            transmittance *= 1.0 - opacity;
            if transmittance < STOP_TRANSMITTANCE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        if transmittance < STOP_TRANSMITTANCE { (color / sum, 1.0) } else { (color, sum) }
    }
}
