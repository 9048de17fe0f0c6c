//! The coefficients of leaves in memory: those of every leaf, or a codebook that leaves share.

use std::{borrow::Cow, sync::Arc};

use half::f16;

use super::basis::Basis;

/// The coefficients of a packed field. Obtained from [`PlenOctree::codebook`](crate::PlenOctree::codebook).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Codebook<'a> {
    /// Coefficients of the constant function of every leaf: red's, green's and blue's.
    pub constants: &'a [[f16; 3]],
    /// Row of every leaf. Empty if the basis has only one function.
    pub rows: &'a [u16],
    /// All rows. Each holds the coefficients of the other functions: all of red's, then green's, then blue's.
    pub table: &'a [f16],
}

/// The coefficients of all leaves. Clones share the arrays.
#[derive(Clone, Debug)]
pub(crate) enum Coefficients {
    /// [`Basis::coefficients`] per leaf.
    Each(Arc<Vec<f16>>),
    /// A [`Codebook`].
    Shared { constants: Arc<Vec<[f16; 3]>>, rows: Arc<Vec<u16>>, table: Arc<Vec<f16>> },
}

impl Coefficients {
    /// Calls `visit` with every coefficient of a leaf and the index of its function: those of one channel after another.
    #[inline]
    pub fn visit(&self, basis: Basis, leaf: usize, mut visit: impl FnMut(usize, f16)) {
        let functions = basis.functions();
        match self {
            Self::Each(all) => {
                for channel in all[leaf * 3 * functions..][..3 * functions].chunks_exact(functions) {
                    channel.iter().enumerate().for_each(|(function, k)| visit(function, *k));
                }
            }
            Self::Shared { constants, rows, table } => {
                let others = functions - 1;
                let row = match rows.get(leaf) {
                    Some(row) => &table[usize::from(*row) * 3 * others..][..3 * others],
                    None => &[],
                };
                for (channel, constant) in constants[leaf].into_iter().enumerate() {
                    visit(0, constant);
                    let others = &row[channel * others..][..others];
                    others.iter().enumerate().for_each(|(function, k)| visit(function + 1, *k));
                }
            }
        }
    }

    /// Returns the coefficients of a channel of a leaf: that of the constant function, and those of the others.
    #[inline]
    pub fn channel(&self, basis: Basis, leaf: usize, channel: usize) -> (f16, &[f16]) {
        let functions = basis.functions();
        match self {
            Self::Each(all) => {
                let k = &all[(leaf * 3 + channel) * functions..][..functions];
                (k[0], &k[1..])
            }
            Self::Shared { constants, rows, table } => {
                let others = functions - 1;
                let row = rows.get(leaf).map_or(0, |row| usize::from(*row) * 3 * others);
                (constants[leaf][channel], &table[row + channel * others..][..others])
            }
        }
    }

    /// Returns the coefficients of all leaves, one leaf after another.
    pub fn all(&self, basis: Basis) -> Cow<'_, [f16]> {
        match self {
            Self::Each(all) => Cow::Borrowed(all),
            Self::Shared { constants, .. } => {
                let mut all = Vec::with_capacity(constants.len() * basis.coefficients());
                (0..constants.len()).for_each(|leaf| self.visit(basis, leaf, |_, k| all.push(k)));
                Cow::Owned(all)
            }
        }
    }

    /// Returns the coefficients of these leaves, in this order. A codebook stays one.
    pub fn select(&self, basis: Basis, leaves: impl Iterator<Item = usize> + Clone) -> Self {
        match self {
            Self::Each(all) => {
                let width = basis.coefficients();
                Self::Each(Arc::new(leaves.flat_map(|leaf| &all[leaf * width..][..width]).copied().collect()))
            }
            Self::Shared { constants, rows, table } => Self::Shared {
                constants: Arc::new(leaves.clone().map(|leaf| constants[leaf]).collect()),
                rows: Arc::new(leaves.filter_map(|leaf| rows.get(leaf).copied()).collect()),
                table: table.clone(),
            },
        }
    }
}
