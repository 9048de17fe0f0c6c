//! The colors that shaders look up by index: palettes, and the pairs of ramps that have lines of ink.

use std::hash::BuildHasher;

use bevy::{
    platform::{collections::HashMap, hash::FixedHasher},
    prelude::*,
};

/// The colors of a frame. Those that stay the same keep their place from frame to frame, so that views do not draw
/// labels again because of palettes that they do not show.
#[derive(Default)]
pub(super) struct PlacedColors {
    pub list: Vec<Vec4>,
    /// Where colors are, by a number that is different for different ones, and by how many there are.
    places: HashMap<(u64, usize), Place>,
    /// Where others were, by how many.
    free: HashMap<usize, Vec<usize>>,
}

struct Place {
    first: usize,
    is_used: bool,
}

impl PlacedColors {
    /// Begins a frame. Colors that the last one did not use make room for as many others.
    pub fn begin(&mut self) {
        self.places.retain(|(_, count), place| {
            let is_used = std::mem::take(&mut place.is_used);
            if !is_used {
                self.free.entry(*count).or_default().push(place.first);
            }
            is_used
        });
        if self.places.is_empty() {
            self.list.clear();
            self.free.clear();
        }
    }

    /// Returns the index of the first of `count` colors. They begin with the `given` ones, which determine the `rest`:
    /// that is only computed if they are new.
    pub fn place(&mut self, given: &[Vec4], count: usize, rest: impl FnOnce() -> Vec<Vec4>) -> u32 {
        let hash = FixedHasher.hash_one(bytemuck::cast_slice::<_, u8>(given));
        let place = self.places.entry((hash, count)).or_insert_with(|| {
            let first = self.free.get_mut(&count).and_then(Vec::pop).unwrap_or_else(|| {
                self.list.resize(self.list.len() + count, Vec4::ZERO);
                self.list.len() - count
            });
            let colors = given.iter().copied().chain(rest());
            self.list[first..first + count].iter_mut().zip(colors).for_each(|(to, color)| *to = color);
            Place { first, is_used: true }
        });
        place.is_used = true;
        place.first as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colors keep their place while they are used, and the list does not grow while others change in every frame.
    #[test]
    fn colors_keep_their_place_and_make_room_for_others() {
        let mut placed = PlacedColors::default();
        let place = |placed: &mut PlacedColors, gray: f32| {
            let first = placed.place(&[Vec4::splat(gray)], 2, || vec![Vec4::splat(-gray)]);
            assert_eq!(placed.list[first as usize..][..2], [Vec4::splat(gray), Vec4::splat(-gray)]);
            first
        };
        placed.begin();
        assert_eq!([0.1, 0.2, 0.1].map(|gray| place(&mut placed, gray)), [0, 2, 0]);
        // A single one that looks the same is another one.
        assert_eq!(placed.place(&[Vec4::splat(0.1)], 1, Vec::new), 4);
        placed.begin();
        assert_eq!(placed.place(&[Vec4::splat(0.2)], 2, || panic!("it is not new")), 2);
        for frame in 1..100 {
            placed.begin();
            assert_eq!(place(&mut placed, 0.2), 2);
            place(&mut placed, frame as f32);
        }
        assert!(placed.list.len() <= 7);
        (0..2).for_each(|_| placed.begin());
        assert!(placed.list.is_empty());
    }
}
