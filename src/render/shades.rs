//! What labels show in more or less light: the shown color of a lighter or darker label of the same ramp or, where
//! there is none, of the same hue. Where these end, the rest of the light changes that color. These labels are found
//! once per palette and light, so that a pixel takes one load.

use std::hash::BuildHasher;

use bevy::{
    platform::{collections::HashMap, hash::FixedHasher},
    prelude::*,
};
use glam::DVec3;
use plenoctree::{
    palette::{Palette, PaletteLabel},
    srgb::{decode, encode},
};

/// Colors that differ from gray by less than this have no hue.
const GRAY: f64 = 0.08;
/// The cosine of the angle within which hues count as the same.
const SAME_HUE: f64 = 0.9;
/// The least factor of light that is left past the lightest label, and the inverse past the darkest one: colors of the
/// palette are shown as they are where they nearly fit.
const LEAST_REST: f64 = 1.25;
/// How bright each channel looks.
const LUMA: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// What each label shows, for each factor of light.
struct Table {
    shades: Vec<Shade>,
    is_used: bool,
}

/// The colors of labels in these lights, in encoded sRGB.
struct LitColors {
    colors: Vec<Vec4>,
    /// Where they begin among the shades of this frame, if it has them.
    first: Option<u32>,
}

/// What a label shows in a light: the shown color of a label, in so much of its linear light.
#[derive(Clone, Copy)]
struct Shade {
    label: usize,
    factor: f64,
}

/// The shades of a view's palettes.
#[derive(Default)]
pub(super) struct Shades {
    /// By the hash of the source colors, the steps of their blends, and the factors.
    tables: HashMap<u64, Table>,
    /// By the hash of what they depend on.
    lit: HashMap<u64, LitColors>,
    /// The shades of this frame, in encoded sRGB.
    pub colors: Vec<Vec4>,
}

/// The most shades of a frame: 64 MiB, half of what a WebGPU binding holds.
const MOST_SHADES: usize = 1 << 22;

impl Shades {
    /// Begins a frame.
    pub fn begin(&mut self) {
        self.tables.retain(|_, table| std::mem::take(&mut table.is_used));
        self.lit.retain(|_, lit| lit.first.take().is_some());
        self.colors.clear();
    }

    /// Returns where in [`Self::colors`] the shades of a palette begin. They have a row for each of the `factors` of
    /// linear light, and in it, what every label of the palette shows. `None` if there are too many.
    ///
    /// The `palette` consists of its source colors and as many shown colors. What is shown is multiplied by the `tint`
    /// later, in linear light. If that is dark, shades may be brighter than white.
    pub fn find(&mut self, palette: &[Vec4], blend_steps: u32, tint: Vec3, factors: &[f32]) -> Option<u32> {
        // Light first makes up for a dark tint. Only the rest of it leads to other labels.
        let most = factors.iter().copied().fold(1.0, f32::max);
        let room = room_of(tint.dot(LUMA.as_vec3()), most);
        let white = Vec3::from(tint.to_array().map(|tint| room_of(tint, most)));
        let steps: Vec<f32> = factors.iter().map(|factor| (factor / room).max(factor.min(1.0))).collect();
        let of_tint = white.extend(room).to_array().map(f32::to_bits);
        let hash = FixedHasher.hash_one((bytes_of(palette), blend_steps, bytes_of(factors), of_tint));
        if let Some(first) = self.lit.get(&hash).and_then(|lit| lit.first) {
            return Some(first);
        }
        let (source, shown) = palette.split_at(palette.len() / 2);
        if self.colors.len() + PaletteLabel::count(source.len(), blend_steps) * factors.len() > MOST_SHADES {
            warn_once!("too many palettes in light: the lights of the scene leave out some props");
            return None;
        }
        let hash_of_table = FixedHasher.hash_one((bytes_of(source), blend_steps, bytes_of(&steps)));
        let table = self.tables.entry(hash_of_table).or_insert_with(|| {
            let ramps = ramps(source, blend_steps);
            let labels: Vec<_> = labels(source, blend_steps).zip(ramps).map(LabelColor::new).collect();
            let row = |factor: &f32| -> Vec<_> {
                (0..labels.len()).map(|label| LabelColor::shade(&labels, label, f64::from(*factor))).collect()
            };
            Table { shades: steps.iter().flat_map(row).collect(), is_used: true }
        });
        table.is_used = true;
        let lit = self.lit.entry(hash).or_insert_with(|| {
            let shown: Vec<Vec3> = labels(shown, blend_steps).map(|color| color.as_vec3()).collect();
            let rows = table.shades.chunks(shown.len().max(1)).zip(factors.iter().zip(&steps));
            let row = |(row, (factor, step)): (&[Shade], (&f32, &f32))| -> Vec<_> {
                let made_up = if factor > step { factor / step } else { 1.0 };
                let color = |shade: &Shade| lightened(shown[shade.label], shade.factor as f32 * made_up, white);
                row.iter().map(|shade| color(shade).extend(0.0)).collect()
            };
            LitColors { colors: rows.flat_map(row).collect(), first: None }
        });
        lit.first = Some(self.colors.len() as u32);
        self.colors.extend(&lit.colors);
        lit.first
    }
}

fn bytes_of<T: bytemuck::NoUninit>(values: &[T]) -> &[u8] {
    bytemuck::cast_slice(values)
}

/// Returns the factor of light that makes up for a tint, or nearly: in steps, so that props with different tints share
/// shades.
fn room_of(tint: f32, most: f32) -> f32 {
    (0.25 * (4.0 * tint.recip().max(1.0).min(most).log2()).floor()).exp2()
}

/// Returns the colors of all labels of a palette.
fn labels(colors: &[Vec4], blend_steps: u32) -> impl Iterator<Item = DVec3> {
    let color = |index: usize| colors[index].truncate().as_dvec3();
    PaletteLabel::all(colors.len(), blend_steps)
        .map(move |label| color(label.second).lerp(color(label.first), label.share))
}

/// Returns the ramp of every label of a palette, unless it blends two, or its colors are in none.
fn ramps(source: &[Vec4], blend_steps: u32) -> impl Iterator<Item = Option<u32>> {
    let ramp = |index: usize| Some(source[index].w as u32).filter(|ramp| (*ramp as usize) < Palette::MAX_COLORS);
    PaletteLabel::all(source.len(), blend_steps)
        .map(move |label| ramp(label.first).filter(|_| ramp(label.first) == ramp(label.second)))
}

/// Multiplies the linear light of a color in encoded sRGB. What would get brighter than white, in linear light, moves
/// toward it in Oklab instead.
fn lightened(encoded: Vec3, factor: f32, white: Vec3) -> Vec3 {
    if factor == 1.0 {
        return encoded;
    }
    let linear = LinearRgba::from(Srgba::from_vec3(encoded.max(Vec3::ZERO))).to_vec3() / white;
    let fits = (1.0 / linear.max_element().max(1e-20)).clamp(factor.min(1.0), factor);
    let color = LinearRgba::from_vec3(linear * fits);
    let shown =
        |color: LinearRgba| Srgba::from(LinearRgba::from_vec3(color.to_vec3().max(Vec3::ZERO) * white)).to_vec3();
    if fits >= factor {
        return shown(color);
    }
    let lab = Oklaba::from(color);
    let lightness = (lab.lightness * (factor / fits).cbrt()).min(lab.lightness.max(1.0));
    shown(LinearRgba::from(lab.with_lightness(lightness)))
}

/// The ramp, the hue and the lightness of a label, in encoded sRGB.
struct LabelColor {
    ramp: Option<u32>,
    color: DVec3,
    /// The difference from gray, and its length.
    chroma: DVec3,
    saturation: f64,
    luma: f64,
}

impl LabelColor {
    fn new((color, ramp): (DVec3, Option<u32>)) -> Self {
        let luma = color.dot(LUMA);
        let chroma = color - color.element_sum() / 3.0;
        Self { ramp, color, chroma, saturation: chroma.length(), luma }
    }

    /// Returns whether it is of the material of another label.
    fn is_like(&self, other: &Self) -> bool {
        if let (Some(own), Some(ramp)) = (self.ramp, other.ramp) {
            return own == ramp;
        }
        match [self, other].map(|label| label.saturation) {
            [a, b] if a < GRAY || b < GRAY => a < GRAY && b < GRAY,
            [a, b] => self.chroma.dot(other.chroma) >= SAME_HUE * a * b,
        }
    }

    /// Returns what the label at an index shows in a light: of the darker or lighter labels of its material, the one
    /// nearest to its own color in that light, or itself if none is nearer. Past the darkest or the lightest one, that
    /// gets the rest of the light.
    fn shade(labels: &[Self], own: usize, factor: f64) -> Shade {
        let label = &labels[own];
        let wanted = DVec3::from(label.color.to_array().map(|channel| encode(decode(channel) * factor)));
        let step = |from: &Self, to: &Self| (to.luma - from.luma) * (factor - 1.0);
        let shades = labels.iter().enumerate().filter(|(_, other)| step(label, other) > 0.0 && other.is_like(label));
        let nearest = shades.map(|(index, other)| (other.color.distance_squared(wanted), index));
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, found)) = nearest.filter(|(off, _)| *off < label.color.distance_squared(wanted)) else {
            return Shade { label: own, factor };
        };
        let shade = &labels[found];
        if labels.iter().any(|other| step(shade, other) > 0.0 && other.is_like(label)) {
            return Shade { label: found, factor: 1.0 };
        }
        let rest = factor * label.light() / shade.light();
        let is_left = if factor > 1.0 { rest > LEAST_REST } else { rest < LEAST_REST.recip() };
        Shade { label: found, factor: if is_left { rest } else { 1.0 } }
    }

    /// Returns how bright the label is, in linear light.
    fn light(&self) -> f64 {
        DVec3::from(self.color.to_array().map(decode)).dot(LUMA).max(1e-6)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The last channel of a color that is in no ramp.
    const NO_RAMP: f32 = Palette::MAX_COLORS as f32;

    /// Returns what the labels of a palette show in light, row by row.
    fn shades(colors: &[Vec4], blend_steps: u32, factors: &[f32]) -> Vec<Vec4> {
        let mut shades = Shades::default();
        assert_eq!(shades.find(colors, blend_steps, Vec3::ONE, factors), Some(0));
        let found = shades.colors.clone();
        // Once a frame.
        assert_eq!(shades.find(colors, blend_steps, Vec3::ONE, factors), Some(0));
        assert_eq!(shades.colors, found);
        shades.begin();
        assert!(shades.colors.is_empty());
        found
    }

    /// In light and shadow, tones step along those of their ramp or, without one, of their hue, and change their own light
    /// where these end.
    #[test]
    fn tones_step_along_their_ramp_or_their_hue() {
        let reds = |ramp| [0.3, 0.6, 0.9].map(|red| Vec4::new(red, 0.2 * red, 0.1 * red, ramp));
        let blues = [0.4, 0.8].map(|blue| Vec4::new(0.1 * blue, 0.3 * blue, blue, NO_RAMP));
        // They have the hue of the reds.
        let browns = [0.45, 0.75].map(|brown| Vec4::new(brown, 0.3 * brown, 0.2 * brown, 1.0));
        let shown: [Vec4; 5] = std::array::from_fn(|index| Vec4::new(0.5, 0.1 * index as f32, 0.2, 0.0));
        for (reds, others) in [(reds(NO_RAMP), blues), (reds(0.0), browns)] {
            let colors = [&reds[..], &others, &shown].concat();
            let found = shades(&colors, 1, &[0.4, 1.0, 5.0]);
            let own = |index: usize, factor| lightened(shown[index].truncate(), factor, Vec3::ONE).extend(0.0);
            assert_eq!(found[..5], [own(0, 0.4), shown[0], shown[1], own(3, 0.4), shown[3]]);
            assert_eq!(found[5..10], shown);
            // The lightest ones do not show all of the light.
            let rest = |from: usize, to: usize| (5.0 * light(colors[from]) / light(colors[to])) as f32;
            assert!(rest(1, 2) > 1.5 && rest(3, 4) > 1.25);
            assert_eq!(found[10..], [shown[1], own(2, rest(1, 2)), own(2, 5.0), own(4, rest(3, 4)), own(4, 5.0)]);
        }
    }

    fn light(color: Vec4) -> f64 {
        LabelColor::new((color.truncate().as_dvec3(), None)).light()
    }

    /// At night, a dark tint follows, so what is shown may be brighter than white before it: then light has the same
    /// effect on all tones.
    #[test]
    fn a_dark_tint_leaves_room_for_light() {
        let reds = [Vec3::new(0.4, 0.06, 0.05), Vec3::new(0.6, 0.12, 0.1), Vec3::new(0.75, 0.2, 0.18)];
        let colors: Vec<Vec4> = [reds, reds].concat().into_iter().map(|color| color.extend(0.0)).collect();
        for (tint, is_whole) in [(Vec3::new(0.2, 0.2, 0.25), true), (Vec3::ONE, false)] {
            let mut shades = Shades::default();
            assert_eq!(shades.find(&colors, 1, tint, &[4.0]), Some(0));
            let gains = shades.colors.iter().zip(&colors).map(|(lit, own)| light(*lit) / light(*own));
            // The darkest one becomes another one.
            let mut gains = gains.skip(1);
            assert_eq!(gains.all(|gain| (gain - 4.0).abs() < 0.01), is_whole, "{tint}");
        }
    }

    /// Props with the same palette may blend it in different steps.
    #[test]
    fn steps_of_blends_have_shades_of_their_own() {
        let colors: [Vec4; 4] = std::array::from_fn(|index| Vec3::splat(0.25 * index as f32).extend(NO_RAMP));
        let mut shades = Shades::default();
        assert_eq!(shades.find(&colors, 1, Vec3::ONE, &[0.5, 1.0]), Some(0));
        assert_eq!(shades.find(&colors, 3, Vec3::ONE, &[0.5, 1.0]), Some(4));
        assert_eq!(shades.colors.len(), 4 + 8);
    }

    /// Colors in light are computed once, as long as the palette and the light stay the same.
    #[test]
    fn lit_colors_are_kept() {
        let mut colors: [Vec4; 4] = std::array::from_fn(|index| Vec3::splat(0.25 * index as f32).extend(NO_RAMP));
        let mut shades = Shades::default();
        let mut frame = |colors: &[Vec4], factor: f32| {
            shades.begin();
            assert_eq!(shades.find(colors, 1, Vec3::ONE, &[factor]), Some(0));
            (shades.colors.clone(), shades.lit.len())
        };
        let found = frame(&colors, 0.5);
        assert_eq!(found.1, 1);
        assert_eq!(frame(&colors, 0.5), found);
        assert!(frame(&colors, 0.7).0 != found.0);
        assert_eq!(frame(&colors, 0.5), (found.0.clone(), 2));
        colors[2].x = 0.9;
        assert!(frame(&colors, 0.5).0 != found.0);
    }

    proptest! {
        /// Every label shows something: as dark as without light or darker in shadow, and as light or lighter in light.
        #[test]
        fn shades_are_on_the_right_side(
            source in prop::collection::vec(prop::array::uniform3(0.0f32..1.0), 1..7),
            blend_steps in 1u32..5,
            factor in prop_oneof![0.0f32..0.95, 1.05f32..3.0],
        ) {
            let source: Vec<Vec4> = source.into_iter().map(|color| Vec3::from(color).extend(NO_RAMP)).collect();
            let found = shades(&[&source[..], &source].concat(), blend_steps, &[factor]);
            let own: Vec<DVec3> = labels(&source, blend_steps).collect();
            prop_assert_eq!(own.len(), PaletteLabel::count(source.len(), blend_steps));
            prop_assert_eq!(own.len(), found.len());
            for (own, found) in own.into_iter().zip(found) {
                let luma = |color: DVec3| LabelColor::new((color, None)).luma;
                let step = luma(found.truncate().as_dvec3()) - luma(own);
                prop_assert!(step * f64::from(factor - 1.0) >= -1e-6, "{own} shows {found}");
            }
        }
    }
}
