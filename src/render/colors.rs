//! The colors that shaders look up by index: palettes, and the pairs of ramps that have lines of ink.

use std::hash::{BuildHasher, Hash, Hasher};

use bevy::{
    platform::{collections::HashMap, hash::FixedHasher},
    prelude::*,
};
use plenoctree::{
    PlenOctree,
    palette::{LabelSpace, Palette, tone_space},
};

use crate::palette::{FieldPalette, PaletteOverride, hash_color};

/// The colors of a frame. Those that stay the same keep their place from frame to frame, so that views do not draw
/// labels again because of palettes that they do not show.
#[derive(Default)]
pub(super) struct PlacedColors {
    pub list: Vec<Vec4>,
    /// Where colors are, by a number that is different for different ones, and by how many there are.
    places: HashMap<(u64, usize), Place>,
    /// Where others were, by how many.
    free: HashMap<usize, Vec<usize>>,
    /// The [`version`]s of palettes of fields that have been placed in this frame.
    versions: HashMap<AssetId<PlenOctree>, u64>,
    /// Where palettes are, by the hash of them and their overrides, so that ramps are moved only once.
    palettes: HashMap<u64, KnownPalette>,
}

struct Place {
    first: usize,
    is_used: bool,
}

struct KnownPalette {
    placed: PlacedPalette,
    is_used: bool,
}

/// The location of a palette.
#[derive(Clone, Copy)]
pub(super) struct PlacedPalette {
    /// The index in [`PlacedColors::list`] of the first source color. The shown colors follow the source colors,
    /// both in encoded sRGB, and then the source colors in the space of tones.
    pub first_color: u32,
    /// The number of source colors, which is also the number of shown colors.
    pub colors: u32,
    /// The index of the place of the first source color, where colors are compared with it: itself, or that of a tone.
    pub first_place: u32,
    /// Whether any shown color is not the source color.
    pub is_changed: bool,
    /// A number that is different for other colors, in whatever place.
    pub hash: u64,
}

impl PlacedPalette {
    /// Returns whether labels are tones.
    pub fn is_of_tones(&self) -> bool {
        self.first_place != self.first_color
    }
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
        self.palettes.retain(|_, known| std::mem::take(&mut known.is_used));
        self.versions.clear();
    }

    /// Places the palette of a field, with a prop's or a view's own colors if there are any: source colors with their
    /// ramps, shown colors, the places of the source colors as tones, and these from dark to light, with their indices.
    /// The last two are only computed for colors that the last frame did not have.
    pub fn place_palette(
        &mut self,
        field: AssetId<PlenOctree>,
        palette: &FieldPalette,
        own: Option<&PaletteOverride>,
    ) -> PlacedPalette {
        let mut hasher = FixedHasher.build_hasher();
        self.versions.entry(field).or_insert_with(|| version(palette)).hash(&mut hasher);
        if let Some(own) = own {
            own.hash_colors(&mut hasher);
        }
        let hash = hasher.finish();
        if let Some(known) = self.palettes.get_mut(&hash)
            && let Some(place) = self.places.get_mut(&(known.placed.hash, 4 * known.placed.colors as usize))
        {
            (known.is_used, place.is_used) = (true, true);
            return known.placed;
        }
        let of = palette.palette();
        // Drop colors beyond the maximum, which shaders could not process in time.
        let source = of.colors.get(..Palette::MAX_COLORS).unwrap_or(&of.colors);
        let count = source.len();
        // A color without a ramp is one by itself.
        let ramp = |color| of.ramp_of(color).unwrap_or(Palette::MAX_COLORS + color);
        let numbered = source.iter().enumerate();
        let mut given: Vec<_> = numbered.map(|(i, c)| glam::DVec3::from(*c).as_vec3().extend(ramp(i) as f32)).collect();
        let encoded = |color: Color| Srgba::from(color).to_vec3().extend(0.0);
        given.extend(palette.shown().iter().take(count).map(|color| encoded(*color)));
        if let Some(own) = own {
            own.apply(of, |index, color| {
                if index < count {
                    given[count + index] = encoded(color);
                }
            });
        }
        let is_changed = (0..count).any(|index| given[index].truncate() != given[count + index].truncate());
        let first_color = self.place(&given, 4 * count, || {
            let places: Vec<Vec3> =
                source.iter().map(|color| tone_space(glam::DVec3::from(*color)).as_vec3()).collect();
            let mut sorted: Vec<Vec4> =
                (0u16..).zip(&places).map(|(index, place)| place.extend(index.into())).collect();
            sorted.sort_by(|a, b| a.x.total_cmp(&b.x));
            places.iter().map(|place| place.extend(0.0)).chain(sorted).collect()
        });
        let colors = count as u32;
        let first_place = if of.label_space() == LabelSpace::Encoded { first_color } else { first_color + 2 * colors };
        let placed = PlacedPalette { first_color, colors, first_place, is_changed, hash: hash_of(&given) };
        self.palettes.insert(hash, KnownPalette { placed, is_used: true });
        placed
    }

    /// Returns the index of the first of `count` colors. They begin with the `given` ones, which determine the `rest`:
    /// that is only computed if they are new.
    pub fn place(&mut self, given: &[Vec4], count: usize, rest: impl FnOnce() -> Vec<Vec4>) -> u32 {
        let place = self.places.entry((hash_of(given), count)).or_insert_with(|| {
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

fn hash_of(colors: &[Vec4]) -> u64 {
    FixedHasher.hash_one(bytemuck::cast_slice::<_, u8>(colors))
}

/// Returns a number that is different for palettes that an override shows differently.
fn version(palette: &FieldPalette) -> u64 {
    let mut hasher = FixedHasher.build_hasher();
    let Palette { colors, weights, method, ramps, shown: _ } = palette.palette();
    hasher.write(bytemuck::cast_slice(colors));
    hasher.write(bytemuck::cast_slice(weights));
    method.hash(&mut hasher);
    ramps.iter().for_each(|ramp| (&ramp.name, &ramp.tones).hash(&mut hasher));
    palette.shown().iter().for_each(|color| hash_color(*color, &mut hasher));
    hasher.finish()
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

    /// Ramps that are overridden are moved once, not in every frame, until the override or the palette changes.
    #[test]
    fn overrides_are_applied_once() {
        let mut source = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.2, 0.3, 0.7]]).unwrap();
        source.gather_tones(&[0, 1], "cap").unwrap();
        let mut palette = FieldPalette::new(source);
        let mut placed = PlacedColors::default();
        // Returns the number of palettes that are known, once a frame has placed palettes.
        let mut frame = |palette: &FieldPalette, owns: &[&PaletteOverride]| {
            placed.begin();
            for own in owns {
                let at = placed.place_palette(AssetId::default(), palette, Some(*own));
                let shown = &placed.list[at.first_color as usize + 3..][..3];
                let expected = own.shown(palette).into_iter().map(|color| Srgba::from(color).to_vec3().extend(0.0));
                assert_eq!(shown, expected.collect::<Vec<_>>());
            }
            placed.palettes.len()
        };
        let [green, blue] = [Color::srgb(0.2, 0.7, 0.3), Color::srgb(0.2, 0.3, 0.9)]
            .map(|color| PaletteOverride::default().with_ramp("cap", color));
        let white = green.clone().with(0, Color::WHITE);
        for _ in 0..3 {
            assert_eq!(frame(&palette, &[&green, &blue, &green, &white]), 3);
        }
        palette.set(2, Color::BLACK);
        assert_eq!(frame(&palette, &[&green]), 4);
        palette.edit_ramps(|palette| palette.rename_ramp(0, "hat")).unwrap();
        assert_eq!(frame(&palette, &[&green]), 2);
        assert_eq!(frame(&palette, &[&green]), 1);
        assert_eq!(frame(&palette, &[]), 1);
        assert_eq!(frame(&palette, &[]), 0);
    }
}
