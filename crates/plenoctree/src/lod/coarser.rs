//! Levels of detail with larger cells.

use std::sync::Arc;

use glam::DVec3;
use half::f16;
use rayon::prelude::*;

use crate::field::{Cell, Coefficients, PlenOctree};

impl PlenOctree {
    /// Returns the field with its finest cells merged, eight into one, `levels` times. Returns `None` if `levels` is
    /// not less than the depth.
    ///
    /// Use it in place of the field where its cells are no larger than a pixel.
    ///
    /// A merged cell gets the density that lets as much light through as its parts, averaged over rays along the three
    /// axes. This is the mean density if the parts are thin, and less if rays can pass by the dense parts. Its
    /// coefficients are the means of those of its parts, weighted by the light that each part absorbs. This averages
    /// the sums of the harmonics, not the radiance after activation. The coarser version of a packed field is not
    /// packed.
    pub fn coarser(&self, levels: u32) -> Option<Self> {
        let mut field = self.clone();
        for _ in 0..levels {
            field = field.merge_finest()?;
        }
        Some(field)
    }

    fn merge_finest(&self) -> Option<Self> {
        if self.depth() < 2 {
            return None;
        }
        let mut merge = Merge { field: self, nodes: vec![[Cell::EMPTY; 8]], leaves: Vec::new() };
        merge.copy(0, 0, 1);
        let Merge { nodes, leaves, .. } = merge;
        // Widths of the finest cells, in world units.
        let widths = (self.frame().scale * f64::from(1u32 << self.depth())).recip();
        let densities = leaves.par_iter().map(|leaf| match leaf {
            NewLeaf::Same(leaf) => self.densities()[*leaf as usize],
            // A merged leaf must have a density, however faint.
            NewLeaf::Merged(node) => {
                (density(self.node_densities(*node), widths) as f32).clamp(f32::MIN_POSITIVE, f32::MAX)
            }
        });
        let coefficients = leaves.par_iter().flat_map_iter(|leaf| match leaf {
            NewLeaf::Same(leaf) => self.leaf_coefficients(*leaf),
            NewLeaf::Merged(node) => self.mean_coefficients(*node, widths.element_product().cbrt()),
        });
        let coefficients = Coefficients::Each(Arc::new(coefficients.collect()));
        Some(self.with_tree(nodes, densities.collect::<Vec<_>>().into(), coefficients))
    }

    fn leaf_coefficients(&self, leaf: u32) -> Vec<f16> {
        let mut coefficients = Vec::with_capacity(self.basis().coefficients());
        self.stored().visit_halves(self.basis(), leaf as usize, |_, k| coefficients.push(k));
        coefficients
    }

    /// Returns the densities of a node's eight cells, none of which may be subdivided.
    fn node_densities(&self, node: u32) -> [f64; 8] {
        self.nodes()[node as usize]
            .map(|cell| cell.as_leaf().map_or(0.0, |leaf| f64::from(self.densities()[leaf as usize])))
    }

    fn mean_coefficients(&self, node: u32, width: f64) -> Vec<f16> {
        let mut sums = vec![0.0f64; self.basis().coefficients()];
        let mut total = 0.0;
        for leaf in self.nodes()[node as usize].iter().filter_map(|cell| cell.as_leaf()) {
            // Even the faintest leaf counts.
            let weight = (-(-f64::from(self.densities()[leaf as usize]) * width).exp_m1()).max(f64::MIN_POSITIVE);
            total += weight;
            let mut sums = sums.iter_mut();
            self.stored().visit_halves(self.basis(), leaf as usize, |_, k| {
                if let Some(sum) = sums.next() {
                    *sum += weight * k.to_f64();
                }
            });
        }
        sums.into_iter().map(|sum| f16::from_f64(sum / total)).collect()
    }
}

/// Returns the density of the cell that merges eight `cells` of these `widths`.
fn density(cells: [f64; 8], widths: DVec3) -> f64 {
    let along = |axis: usize| {
        let (bit, width) = (4 >> axis, widths[axis]);
        // Limited, so that differences are numbers.
        let depth = |cell: usize| ((cells[cell] + cells[cell | bit]) * width).min(f64::MAX.sqrt());
        let columns = (0..8).filter(|cell| cell & bit == 0).map(depth);
        let least = columns.clone().fold(f64::INFINITY, f64::min);
        let taken = columns.map(|depth| (least - depth).exp_m1()).sum::<f64>() / 4.0;
        (least - taken.ln_1p()) / (2.0 * width)
    };
    (along(0) + along(1) + along(2)) / 3.0
}

/// The origin of a leaf in the coarser field: a leaf, or a node whose cells are merged.
enum NewLeaf {
    Same(u32),
    Merged(u32),
}

struct Merge<'a> {
    field: &'a PlenOctree,
    nodes: Vec<[Cell; 8]>,
    leaves: Vec<NewLeaf>,
}

impl Merge<'_> {
    /// Copies the cells of node `from`, which are at `level`, to node `to`.
    fn copy(&mut self, from: u32, to: usize, level: u32) {
        for (index, cell) in self.field.nodes()[from as usize].iter().enumerate() {
            if let Some(leaf) = cell.as_leaf() {
                self.nodes[to][index] = self.leaf(NewLeaf::Same(leaf));
            } else if let Some(node) = cell.as_node() {
                if level + 1 < self.field.depth() {
                    let below = self.nodes.len();
                    self.nodes.push([Cell::EMPTY; 8]);
                    self.nodes[to][index] = Cell::node(below as u32);
                    self.copy(node, below, level + 1);
                } else if self.field.nodes()[node as usize].iter().any(|cell| cell.as_leaf().is_some()) {
                    self.nodes[to][index] = self.leaf(NewLeaf::Merged(node));
                }
            }
        }
    }

    fn leaf(&mut self, leaf: NewLeaf) -> Cell {
        self.leaves.push(leaf);
        Cell::leaf(self.leaves.len() as u32 - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::{Activation, Basis, Frame, UpAxis},
    };

    /// Holds for any density and any cell size.
    #[test]
    fn uniform_fog_keeps_its_density() {
        for density in [1e-37, 1e-3, 1.0, 1e38] {
            for half in [1e-20, 1.0, 1e30] {
                let (min, max) = (DVec3::splat(-half), DVec3::splat(half));
                let settings =
                    BakeSettings { depth: 2, min, max, basis: Basis::Rgba, min_density: 0.0, ..Default::default() };
                let field = bake(&settings, |_| density, |_| |_| DVec3::ONE).unwrap().coarser(1).unwrap();
                assert_eq!((field.depth(), field.leaves()), (1, 8));
                assert!(
                    field.densities().iter().all(|&d| (f64::from(d) / density - 1.0).abs() < 1e-6),
                    "{density} {half}"
                );
            }
        }
    }

    /// Holds even if `1 - opacity` rounds to 1.
    #[test]
    fn thin_cells_merge_to_the_mean_density() {
        let cells = std::array::from_fn(|cell| 1e-14 * cell as f64);
        assert!((density(cells, DVec3::ONE) / 3.5e-14 - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_faintest_leaf_stays_a_leaf() {
        let mut root = [Cell::EMPTY; 8];
        root[0] = Cell::node(1);
        let mut part = [Cell::EMPTY; 8];
        part[0] = Cell::leaf(0);
        let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
        let (density, color) = (vec![f32::from_bits(1)], vec![f16::ONE; 3]);
        let field =
            PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Z, vec![root, part], density, color)
                .unwrap();
        assert_eq!(field.coarser(1).unwrap().leaves(), 1);
    }

    /// Fields with cells of any size can be merged, also where optical depths are 0 or infinite in float64.
    #[test]
    fn optical_depths_beyond_float64_are_merged() {
        for (scale, density) in [(1e300, f32::from_bits(1)), (1e-300, f32::MAX)] {
            let mut root = [Cell::EMPTY; 8];
            root[0] = Cell::node(1);
            let part = std::array::from_fn(|cell| Cell::leaf(cell as u32));
            let frame = Frame { offset: DVec3::ZERO, scale: DVec3::splat(scale) };
            let (nodes, densities, colors) = (vec![root, part], vec![density; 8], vec![f16::from_f32(0.25); 24]);
            let activation = Activation::Identity;
            let field = PlenOctree::new(frame, Basis::Rgba, activation, UpAxis::Z, nodes, densities, colors).unwrap();
            let coarser = field.coarser(1).unwrap();
            let (nodes, densities) = (coarser.nodes().to_vec(), coarser.densities().to_vec());
            let colors = coarser.coefficients().to_vec();
            assert!(colors.iter().all(|k| *k == f16::from_f32(0.25)), "{colors:?}");
            assert!(PlenOctree::new(frame, Basis::Rgba, activation, UpAxis::Z, nodes, densities, colors).is_ok());
        }
    }
}
