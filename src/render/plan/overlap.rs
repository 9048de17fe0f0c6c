//! Finds which rectangles overlap others.

use bevy::math::URect;

/// Returns for every rectangle whether it shares a pixel with another one. Empty rectangles share none.
///
/// Goes through the rectangles from left to right. Those that overlap none so far are compared with every rectangle
/// that begins before they end, but there are few: they share no rows. Of the others, any one is enough.
pub(super) fn overlaps(rects: &[URect]) -> Vec<bool> {
    let mut order: Vec<_> = (0..rects.len()).filter(|index| !rects[*index].is_empty()).collect();
    order.sort_unstable_by_key(|index| rects[*index].min.x);
    let mut found = vec![false; rects.len()];
    let (mut alone, mut met) = (Vec::<usize>::new(), Vec::<usize>::new());
    for index in order {
        let rect = rects[index];
        let meets = |other: &usize| !rect.intersect(rects[*other]).is_empty();
        let goes_on = |other: &usize| rects[*other].max.x > rect.min.x;
        alone.retain(goes_on);
        let known = met.len();
        met.extend(alone.extract_if(.., |other| meets(other)));
        met[known..].iter().for_each(|other| found[*other] = true);
        found[index] = met.len() > known || met.iter().rev().any(meets);
        if found[index] {
            met.push(index);
        } else {
            met.retain(goes_on);
            alone.push(index);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use bevy::math::UVec2;
    use proptest::prelude::*;

    use super::*;

    fn rects(most: usize) -> impl Strategy<Value = Vec<URect>> {
        let rect = (0u32..40, 0u32..40, 0u32..12, 0u32..12);
        prop::collection::vec(rect.prop_map(|(x, y, width, height)| URect::new(x, y, x + width, y + height)), 0..most)
    }

    proptest! {
        #[test]
        fn the_same_as_trying_every_pair(rects in rects(30)) {
            let expected: Vec<_> = rects.iter().enumerate().map(|(index, rect)| {
                let mut others = rects.iter().enumerate().filter(|(other, _)| *other != index);
                others.any(|(_, other)| !rect.intersect(*other).is_empty())
            }).collect();
            prop_assert_eq!(overlaps(&rects), expected);
        }
    }

    /// As many as a view can have, in a grid, and all on top of each other. Trying every pair would take minutes.
    #[test]
    fn scales_to_the_largest_views() {
        let most = crate::gpu::MAX_PROPS_IN_VIEW as u32;
        let grid: Vec<_> = (0..most).map(|at| URect::new(at % 256, at / 256, at % 256 + 1, at / 256 + 1)).collect();
        assert!(overlaps(&grid).iter().all(|overlaps| !overlaps));
        let stack = vec![URect::from_corners(UVec2::ZERO, UVec2::splat(16384)); most as usize];
        assert!(overlaps(&stack).iter().all(|overlaps| *overlaps));
    }
}
