//! Finds which rectangles overlap others.

use bevy::math::URect;

/// Finds which rectangles overlap others, in O(n log n). Keeps its memory.
#[derive(Default)]
pub(super) struct Overlaps {
    /// The left and right sides of the rectangles: x, whether it is a left side, and the index of the rectangle.
    sides: Vec<(u32, bool, usize)>,
    begun: Intervals,
    ended: Intervals,
    counts: Vec<u32>,
}

impl Overlaps {
    /// Returns for every rectangle whether it shares a pixel with another one. Empty rectangles share none.
    pub fn find(&mut self, rects: &[URect]) -> impl Iterator<Item = bool> {
        let Self { sides, begun, ended, counts } = self;
        sides.clear();
        let filled = rects.iter().enumerate().filter(|(_, rect)| !rect.is_empty());
        sides.extend(filled.flat_map(|(index, rect)| [(rect.min.x, true, index), (rect.max.x, false, index)]));
        // Where one rectangle ends and another begins, the first one ends first.
        sides.sort_unstable();
        let height = rects.iter().map(|rect| rect.max.y).max().unwrap_or(0);
        begun.clear(height);
        ended.clear(height);
        counts.clear();
        counts.resize(rects.len(), 0);
        // A rectangle overlaps those that begin before it ends, except for those that end before it begins.
        for (_, begins, index) in sides {
            let rect = &rects[*index];
            if *begins {
                counts[*index] = ended.overlapping(rect);
                begun.insert(rect);
            } else {
                counts[*index] = begun.overlapping(rect) - counts[*index];
                ended.insert(rect);
            }
        }
        // Every rectangle overlaps itself.
        counts.iter().map(|count| *count > 1)
    }
}

/// The vertical sides of a set of rectangles.
#[derive(Default)]
struct Intervals {
    lows: Counts,
    highs: Counts,
}

impl Intervals {
    /// Removes all rectangles. Those that follow are within `height`.
    fn clear(&mut self, height: u32) {
        self.lows.clear(height);
        self.highs.clear(height);
    }

    fn insert(&mut self, rect: &URect) {
        self.lows.insert(rect.min.y);
        self.highs.insert(rect.max.y);
    }

    /// Returns the number of rectangles that share a row with `rect`.
    fn overlapping(&self, rect: &URect) -> u32 {
        self.lows.below(rect.max.y) - self.highs.below(rect.min.y + 1)
    }
}

/// A set of numbers that counts those below another: a Fenwick tree.
#[derive(Default)]
struct Counts(Vec<u32>);

impl Counts {
    /// Removes all numbers. Those that follow are at most `most`.
    fn clear(&mut self, most: u32) {
        self.0.clear();
        self.0.resize(most as usize + 2, 0);
    }

    fn insert(&mut self, number: u32) {
        let mut index = number as usize + 1;
        while let Some(count) = self.0.get_mut(index) {
            *count += 1;
            index += index & index.wrapping_neg();
        }
    }

    fn below(&self, number: u32) -> u32 {
        let (mut index, mut sum) = (number as usize, 0);
        while index > 0 {
            sum += self.0[index];
            index &= index - 1;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use bevy::math::UVec2;
    use proptest::prelude::*;

    use super::*;

    fn rects(most: usize) -> impl Strategy<Value = Vec<URect>> {
        let rect = (0u32..40, 0u32..40, 0u32..12, 0u32..12);
        prop::collection::vec(rect.prop_map(|(x, y, width, height)| URect::new(x, y, x + width, y + height)), 0..most)
    }

    proptest! {
        #[test]
        fn the_same_as_trying_every_pair(first in rects(30), second in rects(8)) {
            let mut overlaps = Overlaps::default();
            for rects in [first, second] {
                let found: Vec<_> = overlaps.find(&rects).collect();
                let expected: Vec<_> = rects.iter().enumerate().map(|(index, rect)| {
                    let mut others = rects.iter().enumerate().filter(|(other, _)| *other != index);
                    others.any(|(_, other)| !rect.intersect(*other).is_empty())
                }).collect();
                prop_assert_eq!(found, expected);
            }
        }
    }

    /// As many as a view can have: all side by side, then all on top of each other. A quadratic search would take
    /// minutes.
    #[test]
    fn scales_to_the_largest_views() {
        let most = crate::gpu::MAX_PROPS_IN_VIEW as u32;
        let rows = (0..most).map(|row| URect::new(0, row, 16384, row + 1)).collect::<Vec<_>>();
        let stack = vec![URect::from_corners(UVec2::ZERO, UVec2::splat(16384)); most as usize];
        let mut overlaps = Overlaps::default();
        let start = Instant::now();
        assert!(overlaps.find(&rows).all(|overlaps| !overlaps));
        assert!(overlaps.find(&stack).all(|overlaps| overlaps));
        assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
    }
}
