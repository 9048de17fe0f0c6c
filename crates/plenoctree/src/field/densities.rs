//! The densities of leaves in memory: one for every leaf, or a few that leaves share.

use std::{ops::Index, sync::Arc};

/// The density of every leaf, per world unit, indexed by leaf. Obtained from
/// [`PlenOctree::densities`](crate::PlenOctree::densities).
///
/// The leaves of a packed field share at most 254 densities, so that each takes a byte. Clones share the arrays.
#[derive(Clone, Debug)]
pub struct Densities {
    values: Arc<Vec<f32>>,
    levels: Option<Arc<Vec<u8>>>,
}

impl Densities {
    /// Creates the densities of leaves that share `values`. `levels` are their indices, which must be valid.
    pub(crate) fn shared(values: Vec<f32>, levels: Vec<u8>) -> Self {
        Self { values: Arc::new(values), levels: Some(Arc::new(levels)) }
    }

    /// Returns the densities that leaves share if there are [`Self::levels`], and otherwise one per leaf.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns which of the [`Self::values`] each leaf of a packed field has, or `None` for other fields.
    pub fn levels(&self) -> Option<&[u8]> {
        self.levels.as_ref().map(|levels| levels.as_slice())
    }

    /// Returns the number of leaves.
    pub fn len(&self) -> usize {
        self.levels.as_ref().map_or(self.values.len(), |levels| levels.len())
    }

    /// Returns whether there are no leaves.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns an iterator over the densities of all leaves.
    pub fn iter(&self) -> impl Iterator<Item = &f32> + Clone {
        (0..self.len()).map(|leaf| &self[leaf])
    }

    /// Returns the densities of all leaves, one after another.
    pub fn to_vec(&self) -> Vec<f32> {
        self.iter().copied().collect()
    }

    /// Returns the densities of these leaves, in this order. Shared ones stay shared.
    pub(crate) fn select(&self, leaves: impl Iterator<Item = usize>) -> Self {
        match &self.levels {
            None => leaves.map(|leaf| self.values[leaf]).collect::<Vec<_>>().into(),
            Some(levels) => {
                let levels = leaves.map(|leaf| levels[leaf]).collect();
                Self { values: self.values.clone(), levels: Some(Arc::new(levels)) }
            }
        }
    }
}

impl From<Vec<f32>> for Densities {
    fn from(each: Vec<f32>) -> Self {
        Self { values: Arc::new(each), levels: None }
    }
}

impl Index<usize> for Densities {
    type Output = f32;

    fn index(&self, leaf: usize) -> &f32 {
        let index = self.levels.as_ref().map_or(leaf, |levels| usize::from(levels[leaf]));
        &self.values[index]
    }
}

/// Equal if all leaves have the same density.
impl PartialEq for Densities {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}
