//! The layout of a leaf's coefficients, in texels of four 32-bit words.

use std::ops::Range;

use half::f16;

use plenoctree::{Basis, Codebook, PlenOctree};

/// The layout of a leaf's coefficients in texels. Shaders are specialized for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Payload {
    pub basis: Basis,
    /// Whether a leaf has a color in 32 bits and the numbers of two rows of codebooks, which hold the other coefficients
    /// as bytes. Texels then have two words. Otherwise, all coefficients are half floats.
    pub has_codebook: bool,
}

impl Payload {
    pub fn of(field: &PlenOctree) -> Self {
        Self { basis: field.basis(), has_codebook: field.codebook().is_some() }
    }

    /// Returns the number of 32-bit words per channel or, with codebooks, per part of a row.
    pub fn words(self) -> usize {
        let functions = self.basis.functions();
        if self.has_codebook { (functions - 1).div_ceil(4) } else { functions.div_ceil(2) }
    }

    /// Returns the number of texels per leaf or, with codebooks, per part of a row.
    pub fn texels(self) -> usize {
        if self.has_codebook { self.words().div_ceil(2) } else { (3 * self.words()).div_ceil(4) }
    }

    /// Returns the numbers of texels of a codebook's densities, rows of luma and rows of differences.
    pub fn texels_of_codebook(self, densities: &[f32], codebook: Codebook) -> [usize; 3] {
        let others = (self.basis.functions() - 1).max(1);
        let [luma, chroma] = [codebook.luma, codebook.chroma].map(|table| table.len() / others * self.texels());
        [densities.len().div_ceil(2), luma, chroma]
    }

    /// Packs the coefficients of several leaves, one leaf after another. There is no codebook.
    pub fn pack(self, coefficients: &[f16]) -> Vec<u32> {
        let leaves = coefficients.chunks_exact(self.basis.coefficients());
        let mut words = Vec::with_capacity(leaves.len() * self.texels() * 4);
        for leaf in leaves {
            let end = words.len() + self.texels() * 4;
            for channel in leaf.chunks_exact(self.basis.functions()) {
                words.extend(channel.chunks(2).map(|pair| halves(pair[0], pair.get(1).copied().unwrap_or(f16::ZERO))));
            }
            words.resize(end, 0);
        }
        words
    }

    /// Packs the densities that leaves share, then the rows of luma and those of differences, one part of a row after
    /// another.
    pub fn pack_codebook(self, densities: &[f32], codebook: Codebook) -> Vec<[u32; 2]> {
        let pair = |pair: &[f32]| [pair[0].to_bits(), pair.get(1).map_or(0, |density| density.to_bits())];
        let others = (self.basis.functions() - 1).max(1);
        let parts = [codebook.luma, codebook.chroma].into_iter().flat_map(|table| table.chunks_exact(others));
        let texels = |part: &[i8]| -> Vec<[u32; 2]> {
            let word = |first: usize| {
                let byte = |index: usize| part.get(first + index).map_or(0, |number| *number as u8);
                u32::from_le_bytes(std::array::from_fn(byte))
            };
            (0..self.texels()).map(|texel| [word(8 * texel), word(8 * texel + 4)]).collect()
        };
        densities.chunks(2).map(pair).chain(parts.flat_map(texels)).collect()
    }

    /// Packs some leaves of a packed field, each in two words: its color, and its rows.
    pub fn pack_leaves(codebook: Codebook, leaves: Range<usize>) -> Vec<u32> {
        let rows = codebook.rows.get(leaves.clone()).unwrap_or_default();
        let rows = rows.iter().copied().chain(std::iter::repeat([0; 2]));
        let leaf = |([y, u, v], [luma, chroma]): (&[i16; 3], [u16; 2])| {
            let bits = |number: i16, bits: u32| number as u32 & ((1 << bits) - 1);
            let color = bits(*y, 12) | bits(*u, 10) << 12 | bits(*v, 10) << 22;
            [color, u32::from(luma) | u32::from(chroma) << 16]
        };
        codebook.colors[leaves].iter().zip(rows).flat_map(leaf).collect()
    }
}

fn halves(low: f16, high: f16) -> u32 {
    u32::from(low.to_bits()) | u32::from(high.to_bits()) << 16
}
