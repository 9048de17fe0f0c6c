//! The coefficients of leaves in memory: those of every leaf, or codebooks that leaves share.

use std::{borrow::Cow, sync::Arc};

use half::f16;

use super::basis::Basis;

/// The coefficients of a packed field. Obtained from [`PlenOctree::codebook`](crate::PlenOctree::codebook).
///
/// All are whole numbers, in steps, of luma `y` and two differences `u` and `v`. Red is `y - v + u`, green `y + v` and
/// blue `y - v - u`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Codebook<'a> {
    /// Step of the coefficients of the constant function.
    pub color_step: f32,
    /// Coefficients of the constant function of every leaf: `y` from -2048 to 2047, `u` and `v` from -512 to 511.
    pub colors: &'a [[i16; 3]],
    /// Rows of luma and of the differences of every leaf. Empty if the basis has only one function.
    pub rows: &'a [[u16; 2]],
    /// Step of the coefficients of the other functions.
    pub table_step: f32,
    /// Rows of luma: the coefficients of the other functions, from -127 to 127.
    pub luma: &'a [i8],
    /// Rows of the differences: all coefficients of `u`, then those of `v`, from -127 to 127.
    pub chroma: &'a [i8],
}

/// The coefficients of all leaves. Clones share the arrays.
#[derive(Clone, Debug)]
pub(crate) enum Coefficients {
    /// [`Basis::coefficients`] per leaf.
    Each(Arc<Vec<f16>>),
    /// A [`Codebook`].
    Shared { colors: Arc<Vec<[i16; 3]>>, rows: Arc<Vec<[u16; 2]>>, tables: Arc<Tables> },
}

/// The parts of a [`Codebook`] that do not depend on the leaf.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tables {
    pub color_step: f32,
    pub table_step: f32,
    pub luma: Vec<i8>,
    pub chroma: Vec<i8>,
}

impl Tables {
    /// Returns the rows of a leaf: of luma, `u` and `v`.
    pub fn rows(&self, [luma, chroma]: [u16; 2], others: usize) -> [&[i8]; 3] {
        let (luma, chroma) = (usize::from(luma) * others, usize::from(chroma) * 2 * others);
        [&self.luma[luma..], &self.chroma[chroma..], &self.chroma[chroma + others..]].map(|row| &row[..others])
    }
}

/// Returns red, green and blue of luma `y` and differences `u` and `v`.
///
/// Luma is a quarter of red and blue plus half of green. `2 u` is red minus blue. `2 v` is green minus the mean of red
/// and blue.
pub(crate) fn to_rgb([y, u, v]: [f64; 3]) -> [f64; 3] {
    [y - v + u, y + v, y - v - u]
}

/// Returns the `y`, `u` and `v` of red, green and blue.
#[cfg(feature = "write")]
pub(crate) fn from_rgb([r, g, b]: [f32; 3]) -> [f32; 3] {
    [(r + 2.0 * g + b) / 4.0, (r - b) / 2.0, (2.0 * g - r - b) / 4.0]
}

impl Coefficients {
    /// Calls `visit` with every coefficient of a leaf and the index of its function: those of one channel after
    /// another.
    #[inline]
    pub fn visit(&self, basis: Basis, leaf: usize, mut visit: impl FnMut(usize, f64)) {
        let functions = basis.functions();
        match self {
            Self::Each(all) => {
                for channel in all[leaf * 3 * functions..][..3 * functions].chunks_exact(functions) {
                    channel.iter().enumerate().for_each(|(function, k)| visit(function, k.to_f64()));
                }
            }
            Self::Shared { colors, rows, tables } => {
                let color = to_rgb(colors[leaf].map(f64::from));
                let rows = rows.get(leaf).map(|rows| tables.rows(*rows, functions - 1));
                for (channel, steps) in color.into_iter().enumerate() {
                    visit(0, steps * f64::from(tables.color_step));
                    for function in 1..functions {
                        let steps = rows.map_or([0.0; 3], |rows| rows.map(|row| f64::from(row[function - 1])));
                        visit(function, to_rgb(steps)[channel] * f64::from(tables.table_step));
                    }
                }
            }
        }
    }

    /// Calls `visit` like [`Self::visit`], with coefficients in half precision: those of codebooks are rounded.
    #[inline]
    pub fn visit_halves(&self, basis: Basis, leaf: usize, mut visit: impl FnMut(usize, f16)) {
        self.visit(basis, leaf, |function, k| {
            let half = f16::from_f64(k);
            visit(function, if half.is_finite() { half } else { f16::MAX.copysign(half) });
        });
    }

    /// Returns red, green and blue of a leaf's coefficients of every function, in half precision.
    #[cfg(feature = "write")]
    pub fn of_functions(&self, basis: Basis, leaf: usize) -> [[f16; 3]; 25] {
        let (mut colors, mut place) = ([[f16::ZERO; 3]; 25], 0);
        self.visit_halves(basis, leaf, |function, k| {
            colors[function][place / basis.functions()] = k;
            place += 1;
        });
        colors
    }

    /// Returns the sums of the harmonics of a leaf's channels. `y` are the values of the basis functions.
    #[inline]
    pub fn sums(&self, basis: Basis, leaf: usize, y: &[f64; 25]) -> [f64; 3] {
        let functions = basis.functions();
        match self {
            Self::Each(all) => {
                let channels = &all[leaf * 3 * functions..][..3 * functions];
                std::array::from_fn(|channel| {
                    let k = &channels[channel * functions..][..functions];
                    k.iter().zip(y).fold(0.0, |sum, (k, y)| sum + k.to_f64() * y)
                })
            }
            Self::Shared { colors, rows, tables } => {
                let constant = f64::from(tables.color_step) * y[0];
                let mut parts = colors[leaf].map(|steps| f64::from(steps) * constant);
                if let Some(rows) = rows.get(leaf) {
                    for (part, row) in parts.iter_mut().zip(tables.rows(*rows, functions - 1)) {
                        let sum: f64 = row.iter().zip(&y[1..]).map(|(steps, y)| f64::from(*steps) * y).sum();
                        *part += f64::from(tables.table_step) * sum;
                    }
                }
                to_rgb(parts)
            }
        }
    }

    /// Returns the coefficients of all leaves, one leaf after another.
    pub fn all(&self, basis: Basis) -> Cow<'_, [f16]> {
        match self {
            Self::Each(all) => Cow::Borrowed(all),
            Self::Shared { colors, .. } => {
                let mut all = Vec::with_capacity(colors.len() * basis.coefficients());
                (0..colors.len()).for_each(|leaf| self.visit_halves(basis, leaf, |_, k| all.push(k)));
                Cow::Owned(all)
            }
        }
    }

    /// Returns the coefficients of these leaves, in this order. Codebooks stay codebooks.
    pub fn select(&self, basis: Basis, leaves: impl Iterator<Item = usize> + Clone) -> Self {
        match self {
            Self::Each(all) => {
                let width = basis.coefficients();
                Self::Each(Arc::new(leaves.flat_map(|leaf| &all[leaf * width..][..width]).copied().collect()))
            }
            Self::Shared { colors, rows, tables } => Self::Shared {
                colors: Arc::new(leaves.clone().map(|leaf| colors[leaf]).collect()),
                rows: Arc::new(leaves.filter_map(|leaf| rows.get(leaf).copied()).collect()),
                tables: tables.clone(),
            },
        }
    }
}
