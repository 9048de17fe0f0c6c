//! Trees of cells that are given by the codes of their lowest finest cells, and what files keep of them.

use glam::UVec3;
use half::f16;
use plenoctree::{Cell, Frame, LoadSettings};

/// Returns the lowest density of leaves that readers of files keep. Files round densities to half floats.
pub fn least_density(frame: Frame) -> f32 {
    let threshold = LoadSettings::default().density_threshold_in(frame);
    let nearest = f16::from_f32(threshold);
    if nearest.to_f32() < threshold { f16::from_bits(nearest.to_bits() + 1).to_f32() } else { nearest.to_f32() }
}

/// Interleaves the bits of a position, x first: the order of leaves.
#[cfg(feature = "fit")]
pub fn morton(position: UVec3) -> u64 {
    let spread = |value: u32| (0..21).map(|bit| u64::from(value >> bit & 1) << (3 * bit)).sum::<u64>();
    spread(position.x) << 2 | spread(position.y) << 1 | spread(position.z)
}

/// Returns the position of a code: the inverse of `morton`.
#[cfg(feature = "splat")]
pub fn position_of(code: u64) -> UVec3 {
    UVec3::new(gather(code >> 2), gather(code >> 1), gather(code))
}

/// Returns every third of the lowest 63 bits: groups of 1, 2, 4, 8 and 16 are moved next to each other.
#[cfg(feature = "splat")]
fn gather(code: u64) -> u32 {
    const GROUPS: [(u32, u64); 5] = [
        (2, 0x10c3_0c30_c30c_30c3),
        (4, 0x100f_00f0_0f00_f00f),
        (8, 0x1f_0000_ff00_00ff),
        (16, 0x1f_0000_0000_ffff),
        (32, 0x1f_ffff),
    ];
    let bits = code & 0x1249_2492_4924_9249;
    GROUPS.iter().fold(bits, |bits, (shift, mask)| (bits | bits >> shift) & mask) as u32
}

/// Returns the nodes of the tree of `depth` levels with these leaves, in ascending order: the code of the lowest finest
/// cell of each, and the binary logarithm of its width in finest cells.
pub fn tree_of(leaves: &[(u64, u32)], depth: u32) -> Vec<[Cell; 8]> {
    let mut nodes = Vec::new();
    append_node(&mut nodes, leaves, 0, depth);
    nodes
}

/// Appends the node that covers `leaves` and all below it. `first` is the index of the first leaf.
fn append_node(nodes: &mut Vec<[Cell; 8]>, leaves: &[(u64, u32)], first: usize, level: u32) {
    let node = nodes.len();
    nodes.push([Cell::EMPTY; 8]);
    let mut start = 0;
    for octant in 0..8 {
        let below = level - 1;
        let count = leaves[start..].partition_point(|(code, _)| code >> (3 * below) & 7 <= octant);
        if count > 0 {
            nodes[node][octant as usize] = if leaves[start].1 == below {
                Cell::leaf((first + start) as u32)
            } else {
                let child = Cell::node(nodes.len() as u32);
                append_node(nodes, &leaves[start..start + count], first + start, below);
                child
            };
        }
        start += count;
    }
}

#[cfg(all(test, feature = "splat"))]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Positions are made of every third bit.
        #[test]
        fn positions_are_every_third_bit(code in any::<u64>()) {
            let gather = |shift: u32| (0..21).map(|bit| ((code >> (3 * bit + shift) & 1) as u32) << bit).sum();
            prop_assert_eq!(position_of(code), UVec3::new(gather(2), gather(1), gather(0)));
        }
    }
}
