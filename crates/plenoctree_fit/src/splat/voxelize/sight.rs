//! How visible cells are from outside, all around.

use glam::DVec3;
use plenoctree::sphere::spiral;
use rayon::prelude::*;

use crate::{cells::Cells, exponential::exp_minus, finest::position_of};

/// Number of directions.
const DIRECTIONS: u32 = 24;

/// How visible a cell is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sight {
    /// Mean square, over directions, of the transmittance of what is in front of the cell.
    pub mean: f32,
    /// The largest transmittance of what is in front of any part of it.
    pub most: f32,
}

/// Looks at cells from outside, along parallel rays in many directions that are a finest cell apart, on all cores.
/// `side` is the number of finest cells per side of the cube.
///
/// Rays shift from slice to slice by whole cells. A large cell is crossed at once, where its middle slice is.
pub fn look(cells: &Cells, side: u32) -> Vec<Sight> {
    let directions: Vec<DVec3> = spiral(DIRECTIONS, [1.0, -1.0]).collect();
    let mut sights = vec![Sight::default(); cells.len()];
    for axis in 0..3 {
        let squares = in_slices((0..cells.len()).into_par_iter().map(|cell| Square::new(cells, cell, axis)).collect());
        let along: Vec<DVec3> = directions.iter().copied().filter(|to| to.abs().max_position() == axis).collect();
        let mut found: Vec<Sight> = squares.par_iter().map(|square| sights[square.cell as usize]).collect();
        // One direction per core at a time: the results of each take as much memory as the cells.
        for directions in along.chunks(rayon::current_num_threads()) {
            let seen: Vec<Vec<[f32; 2]>> =
                directions.par_iter().map(|direction| look_along(*direction, axis, &squares, side)).collect();
            found.par_iter_mut().enumerate().for_each(|(index, sight)| {
                for [mean, most] in seen.iter().map(|seen| seen[index]) {
                    sight.mean += mean / DIRECTIONS as f32;
                    sight.most = sight.most.max(most);
                }
            });
        }
        squares.iter().zip(found).for_each(|(square, sight)| sights[square.cell as usize] = sight);
    }
    sights
}

/// Puts squares in the order of their slices.
fn in_slices(squares: Vec<Square>) -> Vec<Square> {
    let slices = squares.iter().map(|square| usize::from(square.middle) + 1).max().unwrap_or_default();
    let mut next = vec![0; slices + 1];
    squares.iter().for_each(|square| next[usize::from(square.middle) + 1] += 1);
    (0..slices).for_each(|slice| next[slice + 1] += next[slice]);
    let mut order = vec![0; squares.len()];
    for (index, square) in squares.iter().enumerate() {
        let next = &mut next[usize::from(square.middle)];
        order[*next] = index as u32;
        *next += 1;
    }
    order.into_par_iter().map(|index| squares[index as usize]).collect()
}

/// A cell as rays along an axis cross it.
#[derive(Clone, Copy)]
struct Square {
    /// Its index.
    cell: u32,
    /// The lowest corner along the two other axes, in finest cells.
    left: u16,
    top: u16,
    size: u16,
    /// Twice the middle along the axis. Cells with the same middle are next to each other.
    middle: u16,
    thickness: f32,
}

impl Square {
    fn new(cells: &Cells, cell: usize, axis: usize) -> Self {
        let (corner, size) = (position_of(cells.codes[cell]), 1 << cells.levels[cell]);
        let [left, top] = [1, 2].map(|step| corner[(axis + step) % 3] as u16);
        let middle = 2 * corner[axis] as u16 + size;
        Self { cell: cell as u32, left, top, size, middle, thickness: cells.thickness[cell] }
    }
}

/// Returns, for each cell, the mean square and the largest of the transmittances in front of it, along rays in one
/// direction, whose longest component is that along `axis`.
fn look_along(direction: DVec3, axis: usize, squares: &[Square], side: u32) -> Vec<[f32; 2]> {
    let slopes = [1, 2].map(|step| direction[(axis + step) % 3] / direction[axis]);
    // Length of a ray in a slice.
    let length = (1.0 / direction[axis].abs()) as f32;
    // The shifts of each slice, twice as many as slices, so that none is negative.
    let shifts: Vec<[usize; 2]> = (0..=2 * side)
        .map(|middle| {
            slopes.map(|slope| {
                let shift = (0.5 * slope * f64::from(middle)).round();
                (if slope > 0.0 { (slope * f64::from(side)).round() } else { 0.0 } - shift) as usize
            })
        })
        .collect();
    let width = 2 * side as usize + 2;
    let mut through = vec![1.0f32; width * width];
    let mut seen = vec![[0.0; 2]; squares.len()];
    let mut cross = |(square, seen): (&Square, &mut [f32; 2])| {
        let [right, down] = shifts[usize::from(square.middle)];
        let (left, top) = (usize::from(square.left) + right, usize::from(square.top) + down);
        let size = usize::from(square.size);
        let passes = exp_minus(square.thickness * length);
        let rays = &mut through[top * width + left..];
        *seen = match size {
            1 => cross_rows::<1>(rays, width, size, passes),
            2 => cross_rows::<2>(rays, width, size, passes),
            _ => cross_rows::<4>(rays, width, size, passes),
        };
    };
    let both = squares.iter().zip(&mut seen);
    if direction[axis] > 0.0 {
        both.for_each(&mut cross);
    } else {
        both.rev().for_each(&mut cross);
    }
    seen
}

/// Dims the rays of a cell, rows of `size` rays that are `width` apart, by what passes through it. Returns the mean
/// square and the largest of what they were, computed in `LANES` parts.
fn cross_rows<const LANES: usize>(rays: &mut [f32], width: usize, size: usize, passes: f32) -> [f32; 2] {
    let (mut squares, mut most) = ([0.0f32; LANES], [0.0f32; LANES]);
    for row in 0..size {
        for rays in rays[row * width..][..size].as_chunks_mut::<LANES>().0 {
            for lane in 0..LANES {
                squares[lane] += rays[lane] * rays[lane];
                most[lane] = if rays[lane] > most[lane] { rays[lane] } else { most[lane] };
                rays[lane] *= passes;
            }
        }
    }
    [squares.iter().sum::<f32>() / (size * size) as f32, most.into_iter().fold(0.0, f32::max)]
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;

    /// Cells of one size, in order.
    fn cells(level: u8, thickness: impl Fn(UVec3) -> f32) -> Cells {
        let mut cells = Cells::default();
        for code in (0..32u64.pow(3)).step_by(1 << (3 * level)) {
            let thickness = thickness(position_of(code));
            if thickness > 0.0 {
                cells.push(code, level, thickness, 0.0, &[]);
            }
        }
        cells
    }

    /// Only the outside of a dense ball is visible, and all of a haze, by cells of any size.
    #[test]
    fn insides_are_hidden() {
        for level in [0, 1] {
            let radius = |at: UVec3| (at.as_dvec3() + 0.5 * f64::from(1 << level) - 16.0).length();
            let ball = cells(level, |at| if radius(at) < 12.0 { 30.0 } else { 0.0 });
            for (cell, sight) in look(&ball, 32).into_iter().enumerate() {
                let radius = radius(position_of(ball.codes[cell]));
                assert!(radius > 8.0 || sight.most < 1e-3, "{radius} {sight:?}");
                assert!(radius < 11.5 || sight.most > 0.99 && (0.1..0.9).contains(&sight.mean), "{radius} {sight:?}");
            }
            let haze = cells(level, |at| if radius(at) < 12.0 { 1e-4 } else { 0.0 });
            assert!(look(&haze, 32).iter().all(|sight| sight.mean > 0.98 && sight.most > 0.99));
        }
    }

    /// Rays in a slice of finest cells shift, but never past the edge of the picture.
    #[test]
    fn corners_are_in_the_picture() {
        let all = cells(0, |at| if at.to_array().iter().all(|at| [0, 31].contains(at)) { 1.0 } else { 0.0 });
        assert_eq!(all.len(), 8);
        assert!(look(&all, 32).iter().all(|sight| sight.most > 0.99));
    }
}
