//! Levels of detail without faint leaves.

use crate::field::{Cell, PlenOctree};

impl PlenOctree {
    /// Returns the field without the leaves whose density is less than `density_threshold`, per world unit, so that
    /// rays cross fewer leaves. It may be less deep. NaN leaves nothing out, as 0 does.
    ///
    /// [`LoadSettings::density_threshold`](crate::LoadSettings::density_threshold) has the same effect on a file, in boxes
    /// of up to 10 units.
    pub fn thinned(&self, density_threshold: f32) -> Self {
        // Ignores NaN.
        let density_threshold = density_threshold.max(0.0);
        if self.densities().iter().all(|density| *density >= density_threshold) {
            return self.clone();
        }
        self.retain(|leaf| self.densities()[leaf as usize] >= density_threshold)
    }

    /// Returns the field with only the leaves that pass `keep`.
    pub(crate) fn retain(&self, keep: impl Fn(u32) -> bool) -> Self {
        let mut thin = Thin { field: self, keep, nodes: vec![[Cell::EMPTY; 8]], leaves: Vec::new() };
        thin.copy(0, 0);
        let Thin { nodes, leaves, .. } = thin;
        let coefficients = self.stored().select(self.basis(), leaves.iter().map(|leaf| *leaf as usize));
        let densities = self.densities().select(leaves.iter().map(|leaf| *leaf as usize));
        self.with_tree(nodes, densities, coefficients)
    }
}

struct Thin<'a, K> {
    field: &'a PlenOctree,
    keep: K,
    nodes: Vec<[Cell; 8]>,
    /// The leaves to keep, in the order of the new field.
    leaves: Vec<u32>,
}

impl<K: Fn(u32) -> bool> Thin<'_, K> {
    /// Copies the remaining cells of node `from` to node `to`, leaving out nodes that would be empty.
    fn copy(&mut self, from: u32, to: usize) {
        for (index, cell) in self.field.nodes()[from as usize].iter().enumerate() {
            if let Some(leaf) = cell.as_leaf() {
                if (self.keep)(leaf) {
                    self.nodes[to][index] = Cell::leaf(self.leaves.len() as u32);
                    self.leaves.push(leaf);
                }
            } else if let Some(node) = cell.as_node() {
                let (below, before) = (self.nodes.len(), self.leaves.len());
                self.nodes.push([Cell::EMPTY; 8]);
                self.copy(node, below);
                if self.leaves.len() > before {
                    self.nodes[to][index] = Cell::node(below as u32);
                } else {
                    self.nodes.truncate(below);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };

    #[test]
    fn dense_leaves_stay_and_look_the_same() {
        let settings = BakeSettings { depth: 5, basis: Basis::Sh4, min_density: 0.0, ..Default::default() };
        let tint = |at: DVec3| move |direction: DVec3| 0.5 + 0.2 * at + 0.1 * direction;
        let field = bake(&settings, |at| 9.0 * at.x.abs(), tint).unwrap();
        let thinned = field.thinned(4.0);
        let dense = field.densities().iter().filter(|density| **density >= 4.0);
        assert!(thinned.leaves() > 100 && thinned.densities().iter().eq(dense));
        for cell in thinned.leaf_cells() {
            let fine = cell.corner << (field.depth() - thinned.depth());
            let leaf = field.locate(fine).0.as_leaf().unwrap();
            assert_eq!(thinned.radiance(cell.leaf, DVec3::X), field.radiance(leaf, DVec3::X));
        }
        assert_eq!(field.thinned(1e9).leaves(), 0);
        assert_eq!(field.thinned(f32::INFINITY).cell_bounds(), None);
        for nothing in [0.0, -1.0, f32::NAN] {
            assert_eq!(field.thinned(nothing).leaves(), field.leaves());
        }
    }
}
