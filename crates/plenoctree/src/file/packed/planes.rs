//! Numbers as planes of bytes: all lowest bytes, then all next ones. Deflate compresses them better than interleaved
//! bytes.

/// Returns the planes of numbers of `N` bytes, lowest first.
#[cfg(feature = "write")]
pub fn split<const N: usize>(numbers: impl Iterator<Item = [u8; N]> + Clone) -> Vec<u8> {
    (0..N).flat_map(|plane| numbers.clone().map(move |bytes| bytes[plane])).collect()
}

/// Returns the numbers with these planes.
pub fn join<const N: usize>(planes: &[u8]) -> impl Iterator<Item = [u8; N]> {
    let count = planes.len() / N;
    (0..count).map(move |index| std::array::from_fn(|plane| planes[plane * count + index]))
}

/// Interleaves positive and negative numbers, so that small ones have small bytes: 0, -1, 1, -2, 2, ...
#[cfg(feature = "write")]
pub fn fold(number: i32) -> u32 {
    ((number << 1) ^ (number >> 31)) as u32
}

/// Undoes [`fold`].
pub fn unfold(number: u32) -> i32 {
    (number >> 1) as i32 ^ -((number & 1) as i32)
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use super::*;

    #[test]
    fn planes_and_folds_are_undone() {
        let numbers = [0, 1, -1, 77, -300, i32::MAX, i32::MIN];
        let planes = split(numbers.iter().map(|number| fold(*number).to_le_bytes()));
        assert_eq!(planes[..3], [0, 2, 1]);
        let again: Vec<i32> = join(&planes).map(|bytes| unfold(u32::from_le_bytes(bytes))).collect();
        assert_eq!(again, numbers);
    }
}
