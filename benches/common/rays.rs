//! Counts the cells that rays cross, on the CPU, and what shaders load for them.

use std::fmt::{self, Display, Formatter};

use bevy::math::{DVec3, UVec3};
use plenoctree::{
    PlenOctree,
    camera::PinholeCamera,
    sampling::{Progress, SamplingPlan, SamplingSettings},
};

/// About how many rays are counted.
const MOST_RAYS: usize = 1 << 18;

/// What rays cross, in total.
#[derive(Clone, Copy, Default)]
pub struct Rays {
    rays: u64,
    /// Those that reach the edge of the field.
    through: u64,
    cells: u64,
    leaves: u64,
}

impl Rays {
    /// The columns of a table row: means per ray. A step of a ray loads a word of the lattice, or a record of four words
    /// of the octree; then the density of a leaf is another load. Bytes do not include colors.
    pub const COLUMNS: &str =
        "rays to the edge | cells | leaves | loads, lattice | bytes | loads, octree (at most) | bytes";

    /// Follows the rays of radiance sampling, from the centers of leaves, until they are hidden.
    pub fn of_sampling(field: &PlenOctree, settings: &SamplingSettings) -> Self {
        // Nothing cancels it.
        let plan = SamplingPlan::new(field, settings, &Progress::default()).unwrap();
        let directions: Vec<DVec3> = plan.observers.into_iter().flatten().collect();
        let step = (plan.leaves.len() * directions.len() / MOST_RAYS).max(1);
        let limit = -settings.stop_transmittance.ln();
        let mut rays = Self::default();
        for leaf in plan.leaves.iter().step_by(step) {
            let center = leaf.corner.as_dvec3() + 0.5 * f64::from(leaf.size);
            directions.iter().for_each(|direction| rays.follow(field, center, *direction, limit));
        }
        rays
    }

    /// Follows the rays of a view until they are opaque. Leaves out those that miss the box around all leaves.
    pub fn of_view(field: &PlenOctree, view: &PinholeCamera) -> Self {
        let step = f64::from(view.width * view.height / MOST_RAYS as u32).sqrt().ceil().max(1.0) as usize;
        let limit = -SamplingSettings::default().stop_transmittance.ln();
        let cells = f64::from(1u32 << field.depth());
        let mut rays = Self::default();
        for y in (0..view.height).step_by(step) {
            for x in (0..view.width).step_by(step) {
                let (origin, direction) = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                rays.follow(field, field.frame().to_tree(origin) * cells, direction, limit);
            }
        }
        rays
    }

    /// Follows a ray from a point, in finest cells, until its optical depth exceeds a limit.
    fn follow(&mut self, field: &PlenOctree, origin: DVec3, direction: DVec3, limit: f64) {
        let cells = f64::from(1u32 << field.depth());
        let direction = direction * field.frame().scale * cells;
        let is_forward = direction.cmpge(DVec3::ZERO);
        let Some((low, high)) = field.cell_bounds() else { return };
        let [a, b] = [low, high].map(|corner| (corner.as_dvec3() - origin) / direction);
        let enter = a.min(b).max_element().max(0.0);
        if enter > a.max(b).min_element() {
            return;
        }
        // Where the ray is: a little way into the next cell.
        let at = |t: f64| origin + t * direction + 1e-6 * direction.signum();
        let (mut traveled, mut depth, mut position) = (enter, 0.0, at(enter));
        self.rays += 1;
        while position.cmpge(low.as_dvec3()).all() && position.cmplt(high.as_dvec3()).all() {
            let (cell, corner, size) = field.locate(position.as_uvec3());
            let far = DVec3::select(is_forward, (corner + UVec3::splat(size)).as_dvec3(), corner.as_dvec3());
            let exit = ((far - origin) / direction).min_element();
            self.cells += 1;
            if let Some(leaf) = cell.as_leaf() {
                self.leaves += 1;
                depth += f64::from(field.densities()[leaf as usize]) * (exit - traveled);
                if depth > limit {
                    return;
                }
            }
            traveled = exit;
            position = at(exit);
        }
        self.through += 1;
    }
}

impl Display for Rays {
    /// Writes the cells of a table row.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mean = |count: u64| count as f64 / self.rays.max(1) as f64;
        let (cells, leaves) = (mean(self.cells), mean(self.leaves));
        let (lattice, octree) = (4.0 * cells, 16.0 * cells + 4.0 * leaves);
        write!(f, "{:.2} | {cells:.1} | {leaves:.1} | {cells:.1} | {lattice:.0} | ", mean(self.through))?;
        write!(f, "{:.1} | {octree:.0}", cells + leaves)
    }
}
