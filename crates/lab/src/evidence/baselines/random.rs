//! Pseudorandom numbers that are the same on every machine.

/// A generator (splitmix64).
pub struct Random(u64);

impl Random {
    /// Creates a generator. Each seed gives a different sequence.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns a uniformly distributed integer.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns an index below `count`, which must not be 0.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next()) * count as u128) >> 64) as usize
    }

    /// Returns a number from 0 to 1.
    pub fn fraction(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns an index with a probability proportional to its chance, or `None` if all chances are 0.
    pub fn pick(&mut self, chances: &[f64]) -> Option<usize> {
        let mut left = self.fraction() * chances.iter().sum::<f64>();
        let mut last = None;
        for (index, chance) in chances.iter().enumerate().filter(|(_, chance)| **chance > 0.0) {
            last = Some(index);
            left -= chance;
            if left < 0.0 {
                break;
            }
        }
        last
    }
}
