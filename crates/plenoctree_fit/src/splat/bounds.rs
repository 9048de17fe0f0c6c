//! Finds the object in a capture: its box, and its largest connected part.

use glam::{DMat3, DVec3, UVec3};

use super::splats::{Gaussian, Splats};

/// Opacity below which a Gaussian is not drawn.
const FAINTEST: f32 = 1.0 / 255.0;
/// Opacity above which the box must include a Gaussian.
const VISIBLE: f32 = 0.05;
/// Share of the opacity at either end of each axis that is ignored.
const TAIL: f64 = 0.05;
/// How far the box may reach beyond the rest, in multiples of its size.
const BEYOND: f64 = 0.5;
/// Cells per side of the grid in which parts are connected.
const SIDE: u32 = 64;
/// Distance from its center up to which a Gaussian connects cells, in cells.
const FARTHEST: f64 = 4.0;
/// Sum of opacities from which a cell connects to its neighbors.
const SOLID: f32 = 0.5;

impl Splats {
    /// Returns the lowest and the highest corner of the box around the visible Gaussians, without outliers, or `None`
    /// if there are none.
    ///
    /// Along each axis, the box extends the middle 90% by half their length on either side, or by the size of the
    /// median Gaussian if that is more. This contains an object that fills most of the capture. Shells of background
    /// farther away are left out.
    pub fn dense_bounds(&self) -> Option<(DVec3, DVec3)> {
        let visible = || visible(self);
        let (mut low, mut high) = (DVec3::ZERO, DVec3::ZERO);
        let reaches: Vec<DVec3> = visible().map(reach).collect();
        for axis in 0..3 {
            let mut places: Vec<(f32, f32)> =
                visible().map(|gaussian| (gaussian.position[axis], gaussian.opacity)).collect();
            places.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let total: f64 = places.iter().map(|place| f64::from(place.1)).sum();
            let end = |share: f64| {
                let mut sum = 0.0;
                let place = places.iter().find(|place| {
                    sum += f64::from(place.1);
                    sum >= share * total
                });
                place.or(places.last()).map(|place| f64::from(place.0))
            };
            let (first, last) = (end(TAIL)?, end(1.0 - TAIL)?);
            let mut reaches: Vec<f64> = reaches.iter().map(|reach| reach[axis]).collect();
            let middle = reaches.len() / 2;
            let (_, median, _) = reaches.select_nth_unstable_by(middle, f64::total_cmp);
            let beyond = (BEYOND * (last - first)).max(*median);
            (low[axis], high[axis]) = (first - beyond, last + beyond);
        }
        self.bounds_in(low, high)
    }

    /// Returns the lowest and the highest corner of the box around the visible Gaussians whose centers are in a box, or
    /// `None` if there are none. It exceeds the given box by a margin at most.
    pub(super) fn bounds_in(&self, low: DVec3, high: DVec3) -> Option<(DVec3, DVec3)> {
        let places = visible(self).filter_map(|gaussian| {
            let (at, reach) = (gaussian.position.as_dvec3(), reach(gaussian));
            is_inside(at, low, high).then_some((at - reach, at + reach))
        });
        let (first, last) = places.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let (first, last) = (first.max(low), last.min(high));
        // A box around a single point would be empty.
        let extent = (last - first).max_element();
        let rounding = f64::from(f32::EPSILON) * first.abs().max(last.abs()).max_element();
        let margin = if extent > rounding { 0.01 * extent } else { rounding.max(1e-3) };
        Some((first - margin, last + margin))
    }

    /// Returns about how many Gaussians a ray meets on its way through a box, on average.
    pub fn overlap(&self, low: DVec3, high: DVec3) -> f64 {
        let size = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
        // The parts of the box's width that each is visible in, and of its faces.
        let faces = visible(self).map(|gaussian| {
            let [x, y, z] = (2.0 * reach(gaussian) / size).min(DVec3::ONE).to_array();
            (x * y + y * z + z * x) / 3.0
        });
        faces.sum()
    }

    /// Returns the capture without the Gaussians whose centers are outside a box.
    pub fn cropped(&self, low: DVec3, high: DVec3) -> Self {
        self.filtered(|gaussian| is_inside(gaussian.position.as_dvec3(), low, high))
    }

    /// Returns the largest connected part of the content of a box, and its immediate surroundings. The rest are
    /// floaters.
    pub fn largest_part(&self, low: DVec3, high: DVec3) -> Self {
        let width = (high - low).max_element() / f64::from(SIDE);
        let cell_of = |at: DVec3| -> Option<usize> {
            let cell = ((at - low) / width).floor();
            let inside = cell.cmpge(DVec3::ZERO).all() && cell.cmplt(DVec3::splat(SIDE.into())).all();
            inside.then(|| index(cell.as_uvec3()))
        };
        let mut opacity = vec![0.0f32; SIDE.pow(3) as usize];
        for gaussian in self.gaussians() {
            let (at, reach) = (gaussian.position.as_dvec3(), deviations(gaussian));
            let place = |at: DVec3| ((at - low) / width).floor();
            // Large Gaussians connect only cells near their center.
            let (middle, most) = (place(at), DVec3::splat(FARTHEST));
            let first = place(at - reach).max(middle - most).max(DVec3::ZERO).as_uvec3();
            let last = place(at + reach).min(middle + most).min(DVec3::splat((SIDE - 1).into()));
            if last.min_element() >= 0.0 {
                cells(first, last.as_uvec3()).for_each(|cell| opacity[cell] += gaussian.opacity);
            }
        }
        let mut solid: Vec<bool> = opacity.iter().map(|opacity| *opacity >= SOLID).collect();
        let mut largest: (f32, Vec<usize>) = (0.0, Vec::new());
        for start in 0..solid.len() {
            if !std::mem::take(&mut solid[start]) {
                continue;
            }
            let (mut part, mut next) = (vec![start], 0);
            while let Some(&cell) = part.get(next) {
                next += 1;
                for neighbor in around(cell) {
                    if std::mem::take(&mut solid[neighbor]) {
                        part.push(neighbor);
                    }
                }
            }
            let weight = part.iter().map(|cell| opacity[*cell]).sum();
            if weight > largest.0 {
                largest = (weight, part);
            }
        }
        // Nothing is connected in haze.
        if largest.1.is_empty() {
            return self.clone();
        }
        let mut kept = vec![false; opacity.len()];
        for &cell in &largest.1 {
            around(cell).for_each(|neighbor| kept[neighbor] = true);
        }
        self.filtered(|gaussian| cell_of(gaussian.position.as_dvec3()).is_some_and(|cell| kept[cell]))
    }
}

/// Returns the Gaussians that are drawn.
fn visible(splats: &Splats) -> impl Iterator<Item = &Gaussian> {
    splats.gaussians().iter().filter(|gaussian| gaussian.opacity >= FAINTEST)
}

fn is_inside(at: DVec3, low: DVec3, high: DVec3) -> bool {
    at.cmpge(low).all() && at.cmple(high).all()
}

/// Returns the distance from its center, along each axis, within which a Gaussian is visible.
fn reach(gaussian: &Gaussian) -> DVec3 {
    (2.0 * f64::from((gaussian.opacity / VISIBLE).max(1.0)).ln()).sqrt() * deviations(gaussian)
}

/// Returns the standard deviations of a Gaussian along the axes of the capture.
fn deviations(gaussian: &Gaussian) -> DVec3 {
    let axes =
        DMat3::from_quat(gaussian.rotation.as_dquat().normalize()) * DMat3::from_diagonal(gaussian.scale.as_dvec3());
    let rows = axes.transpose();
    DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length())
}

fn index(cell: UVec3) -> usize {
    ((cell.x * SIDE + cell.y) * SIDE + cell.z) as usize
}

/// Returns a cell and its neighbors.
fn around(cell: usize) -> impl Iterator<Item = usize> {
    let cell = cell as u32;
    let cell = UVec3::new(cell / (SIDE * SIDE), cell / SIDE % SIDE, cell % SIDE);
    cells(cell.saturating_sub(UVec3::ONE), (cell + 1).min(UVec3::splat(SIDE - 1)))
}

/// Returns the cells of a box, whose corners are among them.
fn cells(low: UVec3, high: UVec3) -> impl Iterator<Item = usize> {
    (low.x..=high.x)
        .flat_map(move |x| (low.y..=high.y).map(move |y| (x, y)))
        .flat_map(move |(x, y)| (low.z..=high.z).map(move |z| index(UVec3::new(x, y, z))))
}
