//! The path of a ray through the lattice of finest cells.

use std::ops::Range;

use glam::{DVec3, IVec3, UVec3};

/// Width of a block, in finest cells.
pub(super) const SIDE: usize = 8;

/// Where the rays of a path start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Start {
    /// At the center of a finest cell: the center of a leaf of that size.
    Center,
    /// At the lowest corner of a finest cell: the center of a larger leaf.
    Corner,
}

impl Start {
    /// Returns where the rays from the center of a leaf start that is `size` finest cells wide.
    pub fn of(size: u32) -> Self {
        if size > 1 { Self::Corner } else { Self::Center }
    }
}

/// The path of every ray in one direction with the same start: the cells that it crosses, relative to the one where it
/// starts, and its length in each.
pub(super) struct Path {
    /// All cells, in order.
    pub steps: Vec<Step>,
    /// The same cells, grouped by block.
    pub runs: Vec<Run>,
}

/// A cell that the ray crosses. Its offset from the first cell is the offset of its [`Run`], in whole blocks, plus the
/// rest.
pub(super) struct Step {
    /// Rest of the offset along each axis, less than [`SIDE`].
    pub rest: [u8; 3],
    /// Length of the path inside the cell, in world units.
    pub length: f32,
}

/// Consecutive cells with the same offset in whole blocks.
pub(super) struct Run {
    /// Offset in blocks, rounded down.
    pub blocks: IVec3,
    /// Range of the cells in [`Path::steps`].
    pub steps: Range<usize>,
}

impl Path {
    /// Creates the path along `direction`, in finest cells per world unit. It ends where it leaves a box of `extent`
    /// finest cells, wherever in the box it started.
    pub fn new(direction: DVec3, start: Start, extent: UVec3) -> Self {
        let sign = direction.signum().as_ivec3();
        // The distance to the first border on each axis, in cells, and the first cell behind the start.
        let (border, first) = match start {
            Start::Center => (0.5, IVec3::ZERO),
            Start::Corner => (1.0, sign.min(IVec3::ZERO)),
        };
        let per_cell = direction.abs().recip();
        let mut path = Self { steps: Vec::new(), runs: Vec::new() };
        let mut crossed = UVec3::ZERO;
        let mut traveled = 0.0;
        while crossed.cmplt(extent).all() {
            let next = (crossed.as_dvec3() + border) * per_cell;
            let exit = next.min_element();
            path.push(first + crossed.as_ivec3() * sign, exit - traveled);
            traveled = exit;
            let axis = next.to_array().iter().position(|&t| t == exit).unwrap_or(0);
            crossed[axis] += 1;
        }
        path
    }

    /// Returns the number of steps inside the leaf, `size` finest cells wide, at whose center the path starts.
    pub fn steps_within(&self, size: u32) -> usize {
        let low = -((size / 2) as i32);
        let inside = |run: &Run, step: &Step| {
            let offset = run.blocks * SIDE as i32 + IVec3::from_array(step.rest.map(i32::from));
            offset.min_element() >= low && offset.max_element() < low + size as i32
        };
        let steps = self.runs.iter().flat_map(|run| self.steps[run.steps.clone()].iter().map(move |step| (run, step)));
        steps.take_while(|(run, step)| inside(run, step)).count()
    }

    fn push(&mut self, offset: IVec3, length: f64) {
        let side = IVec3::splat(SIDE as i32);
        let (blocks, rest) = (offset.div_euclid(side), offset.rem_euclid(side));
        let index = self.steps.len();
        match self.runs.last_mut() {
            Some(run) if run.blocks == blocks => run.steps.end = index + 1,
            _ => self.runs.push(Run { blocks, steps: index..index + 1 }),
        }
        self.steps.push(Step { rest: rest.to_array().map(|x| x as u8), length: length as f32 });
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// The middle of every step is in the cell that the step names, and the lengths add up to the distance to the
        /// edge of the box.
        #[test]
        fn steps_follow_the_ray(direction in prop::array::uniform3(-1.0..1.0f64), extent in 1u32..40, corner: bool) {
            let direction = DVec3::from_array(direction);
            prop_assume!(direction.length() > 0.1);
            let (start, offset) = if corner { (Start::Corner, 0.0) } else { (Start::Center, 0.5) };
            let path = Path::new(direction, start, UVec3::splat(extent));
            let mut traveled = 0.0;
            for run in &path.runs {
                for step in &path.steps[run.steps.clone()] {
                    let middle = offset + direction * (traveled + 0.5 * f64::from(step.length));
                    let rest = IVec3::from_array(step.rest.map(i32::from));
                    let inside = middle - (run.blocks * 8 + rest).as_dvec3();
                    prop_assert!(inside.min_element() > -1e-4 && inside.max_element() < 1.0 + 1e-4);
                    traveled += f64::from(step.length);
                }
            }
            let expected = (f64::from(extent) - offset) / direction.abs().max_element();
            prop_assert!((traveled - expected).abs() < 1e-4 * expected, "{traveled} {expected}");
        }
    }
}
