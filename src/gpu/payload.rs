//! The layout of a leaf's coefficients, in texels of four 32-bit words.

use half::f16;

use plenoctree::{Basis, PlenOctree, Precision};

/// The layout of a leaf's coefficients in texels. Shaders are specialized for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Payload {
    pub basis: Basis,
    pub compact: bool,
}

impl Payload {
    pub fn of(field: &PlenOctree) -> Self {
        // With fewer functions, bytes would take as many texels as half floats.
        let compact = field.precision() == Precision::Byte && field.basis().functions() >= 9;
        Self { basis: field.basis(), compact }
    }

    /// Returns the number of 32-bit words per channel, without the two leading words of a compact leaf.
    pub fn words_per_channel(self) -> usize {
        let functions = self.basis.functions();
        if self.compact { (functions - 1).div_ceil(4) } else { functions.div_ceil(2) }
    }

    /// Returns the number of texels per leaf.
    pub fn texels(self) -> usize {
        (3 * self.words_per_channel() + if self.compact { 2 } else { 0 }).div_ceil(4)
    }

    /// Packs the coefficients of several leaves, one leaf after another.
    pub fn pack(self, coefficients: &[f16]) -> Vec<u32> {
        let leaves = coefficients.chunks_exact(self.basis.coefficients());
        let mut words = Vec::with_capacity(leaves.len() * self.texels() * 4);
        for leaf in leaves {
            let end = words.len() + self.texels() * 4;
            if self.compact {
                self.pack_bytes(leaf, &mut words);
            } else {
                self.pack_halves(leaf, &mut words);
            }
            words.resize(end, 0);
        }
        words
    }

    /// Packs each channel as pairs of half floats.
    fn pack_halves(self, leaf: &[f16], words: &mut Vec<u32>) {
        for channel in leaf.chunks_exact(self.basis.functions()) {
            words.extend(channel.chunks(2).map(|pair| halves(pair[0], pair.get(1).copied().unwrap_or(f16::ZERO))));
        }
    }

    /// Packs the constant coefficients of the three channels and a scale as half floats, then the other coefficients as
    /// signed bytes. The scale is the largest magnitude of the other coefficients and maps to 127.
    fn pack_bytes(self, leaf: &[f16], words: &mut Vec<u32>) {
        let channels = || leaf.chunks_exact(self.basis.functions());
        let largest = channels().flat_map(|channel| &channel[1..]).map(|k| k.to_f32().abs()).fold(0.0, f32::max);
        let scale = f16::from_f32(largest);
        let quotient = 127.0 / largest.max(f32::MIN_POSITIVE);
        let functions = self.basis.functions();
        words.push(halves(leaf[0], leaf[functions]));
        words.push(halves(leaf[2 * functions], scale));
        for channel in channels() {
            words.extend(channel[1..].chunks(4).map(|four| {
                let bytes: [u8; 4] = std::array::from_fn(|index| {
                    four.get(index).map_or(0, |k| (k.to_f32() * quotient).round() as i8 as u8)
                });
                u32::from_le_bytes(bytes)
            }));
        }
    }
}

fn halves(low: f16, high: f16) -> u32 {
    u32::from(low.to_bits()) | u32::from(high.to_bits()) << 16
}
