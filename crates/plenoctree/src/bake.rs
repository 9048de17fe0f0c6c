//! Baking: turns a procedural volume into a field like a trained one.

use glam::{DVec3, UVec3};
use half::f16;
use rayon::prelude::*;

use crate::{
    cholesky,
    field::{Basis, Cell, Frame, InvalidField, MAX_DEPTH, PlenOctree, UpAxis},
    sphere::spiral,
};

/// Settings of [`bake`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakeSettings {
    /// Depth of the field, 1 to [`MAX_DEPTH`]: it has `2^depth` cells per side. 7 by default.
    pub depth: u32,
    /// Lowest corner of the baked box, in the field's frame. (-1, -1, -1) by default.
    pub min: DVec3,
    /// Highest corner of the baked box, in the field's frame. (1, 1, 1) by default.
    pub max: DVec3,
    /// Basis onto which radiance is projected, with its [default activation](Basis::default_activation). [`Basis::Sh9`]
    /// by default.
    pub basis: Basis,
    /// Axis of the field's frame that points up. [`UpAxis::Z`] by default.
    pub up: UpAxis,
    /// Density, per world unit, below which a cell is empty. 1e-2 by default, which is also the default threshold of
    /// [`LoadSettings`](crate::LoadSettings) in boxes of up to 10 units. Negative values and NaN count as 0. Cells
    /// whose density float32 rounds to 0 are always empty.
    pub min_density: f64,
    /// Number of points along each axis of a cell over which density is averaged. 1 to 64, 2 by default. Values out of
    /// range are clamped.
    pub density_samples: u32,
    /// Number of directions, spread evenly over the sphere, in which radiance is sampled. At least the number of
    /// functions of the basis. 96 by default.
    pub directions: u32,
    /// Step to which coefficients are rounded, which makes files smaller. 0, the default, keeps the full precision of
    /// float16, and so do negative values and NaN.
    pub coefficient_step: f64,
}

impl Default for BakeSettings {
    /// Depth 7, the cube from -1 to 1, nine harmonics, z up.
    fn default() -> Self {
        Self {
            depth: 7,
            min: DVec3::NEG_ONE,
            max: DVec3::ONE,
            basis: Basis::Sh9,
            up: UpAxis::Z,
            min_density: 1e-2,
            density_samples: 2,
            directions: 96,
            coefficient_step: 0.0,
        }
    }
}

/// An error that occurs when baking a volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BakeError {
    /// The depth is 0 or more than [`MAX_DEPTH`].
    #[error("found depth {0}, expected 1 to {MAX_DEPTH}")]
    Depth(u32),
    /// The box is not finite, or is flat or inside out.
    #[error("the box from {min} to {max} has no volume")]
    Box {
        /// Lowest corner of the box, as given.
        min: DVec3,
        /// Highest corner of the box, as given.
        max: DVec3,
    },
    /// There are too few directions to determine the coefficients.
    #[error("{directions} directions are too few to fit {functions} basis functions")]
    Directions {
        /// Number of directions, as given.
        directions: u32,
        /// Number of functions of the basis.
        functions: usize,
    },
    /// The volume has a density or radiance that a field cannot store: NaN, or out of range.
    #[error(transparent)]
    Field(#[from] InvalidField),
}

/// Bakes a volume into a field, on all cores. The result does not depend on the number of cores.
///
/// `density` returns the density, per world unit, at a point in the field's frame. `radiance` is called once with the
/// center of every cell that is not empty, and the closure that it returns is called once with every direction: a unit
/// vector from the eye into the scene. Colors are encoded sRGB, 0 to 1. Work that does not depend on the direction is
/// therefore done only once per cell:
///
/// ```
/// use plenoctree::{BakeSettings, bake};
/// use glam::DVec3;
///
/// let settings = BakeSettings { depth: 5, ..Default::default() };
/// let ball = bake(
///     &settings,
///     |position| if position.length() < 0.8 { 100.0 } else { 0.0 },
///     |position| {
///         let normal = position.normalize();
///         move |direction: DVec3| DVec3::new(0.8, 0.1, 0.1) + 0.2 * normal.dot(-direction).max(0.0)
///     },
/// )?;
/// assert_eq!(ball.depth(), 5);
/// # Ok::<(), plenoctree::BakeError>(())
/// ```
///
/// All leaves are finest cells, as in trained fields. Empty cells are as large as possible.
///
/// # Errors
///
/// Returns an error if the depth, the box or the number of directions is out of range, or if the volume has a density
/// or radiance that a field cannot store.
pub fn bake<D, R, L>(settings: &BakeSettings, density: D, radiance: R) -> Result<PlenOctree, BakeError>
where
    D: Fn(DVec3) -> f64 + Sync,
    R: Fn(DVec3) -> L + Sync,
    L: Fn(DVec3) -> DVec3,
{
    bake_volume(settings, &density, &|center, project| project(&radiance(center)))
}

/// The appearance of a cell, as a function of the direction.
type Radiance<'a> = &'a dyn Fn(DVec3) -> DVec3;

/// [`bake`] for any volume, so that baking is compiled once. `radiance` calls back with the radiance of the cell around
/// a center.
fn bake_volume(
    settings: &BakeSettings,
    density: &(dyn Fn(DVec3) -> f64 + Sync),
    radiance: &(dyn Fn(DVec3, &mut dyn FnMut(Radiance)) + Sync),
) -> Result<PlenOctree, BakeError> {
    let BakeSettings { depth, min, max, basis, up, .. } = *settings;
    if !(1..=MAX_DEPTH).contains(&depth) {
        return Err(BakeError::Depth(depth));
    }
    let size = max - min;
    if !size.is_finite() || size.min_element() <= 0.0 {
        return Err(BakeError::Box { min, max });
    }
    let projection = Projection::new(basis, settings.directions)?;
    let cells = 1u32 << depth;
    let baker = Baker { settings, cell: size / f64::from(cells), projection, density, radiance };
    let mut part = baker.part(UVec3::ZERO, cells);
    if part.nodes.is_empty() {
        part.nodes.push([Cell::EMPTY; 8]);
    }
    let frame = Frame::spanning(min, max);
    let activation = basis.default_activation();
    Ok(PlenOctree::new(frame, basis, activation, up, part.nodes, part.density, part.coefficients)?)
}

struct Baker<'a> {
    settings: &'a BakeSettings,
    /// Width of a finest cell on each axis, in world units.
    cell: DVec3,
    projection: Projection,
    density: &'a (dyn Fn(DVec3) -> f64 + Sync),
    radiance: &'a (dyn Fn(DVec3, &mut dyn FnMut(Radiance)) + Sync),
}

/// A subtree whose indices start at 0. An empty subtree has no nodes.
#[derive(Default)]
struct Part {
    nodes: Vec<[Cell; 8]>,
    density: Vec<f32>,
    coefficients: Vec<f16>,
}

impl Baker<'_> {
    /// Bakes the subtree of the cube at `corner`, which is `size` finest cells wide, at least 2.
    fn part(&self, corner: UVec3, size: u32) -> Part {
        // Cubes up to this width, in finest cells, are not worth a parallel task.
        const TASK: u32 = 16;
        let half = size / 2;
        let octant = |index: u32| corner + half * UVec3::new(index >> 2, (index >> 1) & 1, index & 1);
        let mut whole = Part { nodes: vec![[Cell::EMPTY; 8]], ..Default::default() };
        if half == 1 {
            for index in 0..8 {
                if self.leaf(octant(index), &mut whole) {
                    whole.nodes[0][index as usize] = Cell::leaf(whole.density.len() as u32 - 1);
                }
            }
        } else if size > TASK {
            let octants: Vec<Part> = (0..8).into_par_iter().map(|index| self.part(octant(index), half)).collect();
            for (index, part) in octants.into_iter().enumerate() {
                whole.append(index, part);
            }
        } else {
            for index in 0..8 {
                whole.append(index as usize, self.part(octant(index), half));
            }
        }
        if whole.density.is_empty() { Part::default() } else { whole }
    }

    /// Adds the finest cell at `corner` to the leaves. Returns `false` if the cell is empty.
    fn leaf(&self, corner: UVec3, part: &mut Part) -> bool {
        let place = |offset: DVec3| self.settings.min + (corner.as_dvec3() + offset) * self.cell;
        let n = self.settings.density_samples.clamp(1, 64);
        let mut sum = 0.0;
        for point in 0..n.pow(3) {
            let offset = UVec3::new(point / (n * n), point / n % n, point % n).as_dvec3() + 0.5;
            sum += (self.density)(place(offset / f64::from(n)));
        }
        let mean = sum / f64::from(n.pow(3));
        let density = mean as f32;
        // A density of NaN passes this check. `PlenOctree::new` returns an error for it.
        if mean < self.settings.min_density.max(0.0) || density == 0.0 {
            return false;
        }
        part.density.push(density);
        (self.radiance)(place(DVec3::splat(0.5)), &mut |radiance| {
            self.projection.project(radiance, self.settings.coefficient_step, &mut part.coefficients);
        });
        true
    }
}

impl Part {
    /// Attaches `part` to the cell `index` of the root.
    fn append(&mut self, index: usize, part: Part) {
        if part.nodes.is_empty() {
            return;
        }
        let (node, leaf) = (self.nodes.len() as u32, self.density.len() as u32);
        self.nodes[0][index] = Cell::node(node);
        self.nodes.extend(part.nodes.into_iter().map(|cells| {
            cells.map(|cell| match (cell.as_node(), cell.as_leaf()) {
                (Some(below), _) => Cell::node(below + node),
                (_, Some(below)) => Cell::leaf(below + leaf),
                _ => Cell::EMPTY,
            })
        }));
        self.density.extend(part.density);
        self.coefficients.extend(part.coefficients);
    }
}

/// The least-squares projection of a function on the sphere onto a basis.
struct Projection {
    basis: Basis,
    /// All directions, each with its column of the pseudo-inverse `(Y^T Y)^-1 Y^T`: what a value in that direction adds
    /// to each coefficient.
    columns: Vec<(DVec3, [f64; 25])>,
}

impl Projection {
    fn new(basis: Basis, directions: u32) -> Result<Self, BakeError> {
        let functions = basis.functions();
        let too_few = BakeError::Directions { directions, functions };
        if (directions as usize) < functions {
            return Err(too_few);
        }
        let mut columns: Vec<(DVec3, [f64; 25])> =
            spiral(directions, [1.0, -1.0]).map(|direction| (direction, basis.evaluate(direction))).collect();
        let mut gram = vec![0.0; functions * functions];
        for (_, y) in &columns {
            for i in 0..functions {
                for j in 0..=i {
                    gram[i * functions + j] += y[i] * y[j];
                }
            }
        }
        if cholesky::decompose(&mut gram, functions) <= 1e-9 {
            return Err(too_few);
        }
        for (_, column) in &mut columns {
            cholesky::solve(&gram, &mut column[..functions]);
        }
        Ok(Self { basis, columns })
    }

    fn project(&self, radiance: Radiance, step: f64, coefficients: &mut Vec<f16>) {
        let activation = self.basis.default_activation();
        let functions = self.basis.functions();
        let mut sums = [[0.0; 25]; 3];
        for (direction, column) in &self.columns {
            let color = radiance(*direction).to_array();
            for (channel, sums) in color.iter().zip(&mut sums) {
                let value = activation.invert(*channel);
                for (sum, share) in sums[..functions].iter_mut().zip(column) {
                    *sum += share * value;
                }
            }
        }
        let round = |k: f64| if step > 0.0 { (k / step).round() * step } else { k };
        coefficients.extend(sums.iter().flat_map(|sums| &sums[..functions]).map(|&k| f16::from_f64(round(k))));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::field::Activation;

    fn settings(depth: u32) -> BakeSettings {
        BakeSettings { depth, ..Default::default() }
    }

    fn unit() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0, 0.0..std::f64::consts::TAU).prop_map(|(z, phi): (f64, f64)| {
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * phi.cos(), r * phi.sin(), z)
        })
    }

    proptest! {
        #[test]
        fn fog_keeps_its_density_and_color(
            density in 0.01..500.0,
            color in prop::array::uniform3(0.01..0.99),
            basis in 0..6usize,
            direction in unit(),
        ) {
            let color = DVec3::from_array(color);
            let settings = BakeSettings { basis: Basis::ALL[basis], ..settings(2) };
            let field = bake(&settings, |_| density, |_| move |_| color).unwrap();
            prop_assert_eq!(field.leaves(), 64);
            for leaf in 0..64 {
                prop_assert!((f64::from(field.densities()[leaf]) / density - 1.0).abs() < 1e-6);
                prop_assert!(field.radiance(leaf as u32, direction).distance(color) < 2e-3);
            }
        }

        /// Radiance that the basis can represent is reproduced, no matter how it varies over the sphere and from cell
        /// to cell.
        #[test]
        fn representable_radiance_is_reproduced(
            basis in 1..6usize,
            k in prop::collection::vec(-1.0..1.0, 75),
            directions in prop::collection::vec(unit(), 8),
        ) {
            let basis = Basis::ALL[basis];
            let n = basis.functions();
            let truth = |position: DVec3, direction: DVec3| {
                let y = basis.evaluate(direction);
                DVec3::from_array([0, 1, 2].map(|channel| {
                    let sum: f64 = (0..n).map(|b| k[channel * n + b] * y[b]).sum();
                    Activation::Sigmoid.apply(0.3 * sum * (1.0 + position[channel]))
                }))
            };
            let truth = &truth;
            let settings = BakeSettings { basis, ..settings(1) };
            let field = bake(&settings, |_| 1.0, |position| move |direction| truth(position, direction)).unwrap();
            for cell in field.leaf_cells() {
                let center = (cell.corner.as_dvec3() + 0.5) - 1.0;
                for &direction in &directions {
                    let error = field.radiance(cell.leaf, direction).distance(truth(center, direction));
                    prop_assert!(error < 1e-3, "{:?}: {}", basis, error);
                }
            }
        }

        /// The finest cells with density are leaves, in the order and scale of the axes.
        #[test]
        fn leaves_cover_the_density(low in prop::array::uniform3(0u32..16), size in prop::array::uniform3(1u32..16)) {
            let low = UVec3::from_array(low);
            let high = (low + UVec3::from_array(size)).min(UVec3::splat(16));
            let (min, max) = (DVec3::new(-1.0, 2.0, -3.0), DVec3::new(3.0, 3.0, 5.0));
            let frame = Frame::spanning(min, max);
            let inside = |position: DVec3| {
                let cell = frame.to_tree(position) * 16.0;
                cell.cmpge(low.as_dvec3()).all() && cell.cmplt(high.as_dvec3()).all()
            };
            let settings = BakeSettings { min, max, basis: Basis::Sh1, ..settings(4) };
            let field = bake(&settings, |p| f64::from(u8::from(inside(p))), |_| |_| DVec3::splat(0.5)).unwrap();
            prop_assert_eq!(field.depth(), 4);
            prop_assert_eq!(field.cell_bounds(), Some((low, high)));
            prop_assert_eq!(field.leaves() as u32, (high - low).element_product());
            prop_assert!(field.leaf_cells().all(|cell| cell.size == 1));
        }
    }

    #[test]
    fn empty_volumes_bake_to_empty_fields() {
        let field = bake(&settings(5), |_| 0.009, |_| |_| DVec3::ONE).unwrap();
        assert_eq!((field.leaves(), field.nodes().len()), (0, 1));
    }

    /// Cells are empty where float32, in which fields store densities, has no positive number that small.
    #[test]
    fn densities_too_faint_for_float32_are_empty() {
        let settings = BakeSettings { min_density: 0.0, ..settings(2) };
        let field = bake(&settings, |p| if p.x < 0.0 { 1e-60 } else { 1e-40 }, |_| |_| DVec3::ONE).unwrap();
        assert_eq!(field.leaves(), 32);
        assert!(field.densities().iter().all(|&density| density == 1e-40));
        assert_eq!(bake(&settings, |_| -1e-60, |_| |_| DVec3::ONE).unwrap().leaves(), 0);
    }

    #[test]
    fn density_is_the_mean_over_the_cell() {
        let field =
            bake(&settings(1), |p| if p.x.fract().abs() < 0.5 { 8.0 } else { 0.0 }, |_| |_| DVec3::ONE).unwrap();
        assert!(field.densities().iter().all(|&density| density == 4.0));
    }

    #[test]
    fn coefficients_are_multiples_of_the_step() {
        let settings = BakeSettings { coefficient_step: 1.0 / 16.0, ..settings(2) };
        let field = bake(&settings, |_| 1.0, |p| move |d: DVec3| 0.5 + 0.2 * p * d.x).unwrap();
        assert!(field.coefficients().iter().all(|k| (k.to_f64() * 16.0).fract() == 0.0));
        assert!(field.coefficients().iter().any(|k| k.to_f64() != 0.0));
    }

    #[test]
    fn invalid_volumes_and_settings_are_errors() {
        let gray = |_| |_| DVec3::splat(0.5);
        assert_eq!(bake(&settings(0), |_| 1.0, gray).unwrap_err(), BakeError::Depth(0));
        let flat = BakeSettings { max: DVec3::new(1.0, -1.0, 1.0), ..settings(2) };
        assert!(matches!(bake(&flat, |_| 1.0, gray), Err(BakeError::Box { .. })));
        let few = BakeSettings { directions: 8, ..settings(2) };
        assert!(matches!(bake(&few, |_| 1.0, gray), Err(BakeError::Directions { .. })));
        assert!(matches!(bake(&settings(2), |_| f64::NAN, gray), Err(BakeError::Field(_))));
        let nan = |_| |_| DVec3::splat(f64::NAN);
        assert!(matches!(bake(&settings(2), |_| 1.0, nan), Err(BakeError::Field(_))));
    }
}
