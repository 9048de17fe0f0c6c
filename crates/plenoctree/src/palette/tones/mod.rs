//! Palettes of tones: section 3 of the method, step 11.

mod grow;
mod neutral;
mod points;

pub(super) use grow::{Enough, tones};
pub(super) use points::{binned_colors, points, salient_error, seen_colors};

#[cfg(test)]
mod tests {
    use glam::{DVec3, swizzles::Vec3Swizzles};
    use proptest::prelude::*;

    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
        palette::{
            ColorCount, ColorErrors, ExtractionSettings, Palette, PaletteLabel, PaletteMethod, extract_from_samples,
            oklab::{chroma, from_oklab, oklab},
        },
        sampling::{Histograms, Progress},
    };

    type Weighted = ([f64; 3], f64);

    fn extract(bins: usize, colors: &[Weighted], count: ColorCount) -> (Palette, ColorErrors) {
        let settings = ExtractionSettings { method: PaletteMethod::Tones, colors: count, ..Default::default() };
        let found = extract_from_samples(&Histograms::of(bins, colors), &[], &settings, &Progress::default()).unwrap();
        (found.palette, found.report.errors)
    }

    /// Four materials in light and shadow, and a small purple part with 0.4% of the weight.
    fn materials() -> Vec<Weighted> {
        let shaded = [[0.85, 0.15, 0.15], [0.9, 0.89, 0.87], [0.3, 0.6, 0.2], [0.55, 0.4, 0.3]];
        let shades = |color: [f64; 3]| {
            (0..200).map(move |i| {
                let light = 0.25 + 0.75 * f64::from(i) / 200.0;
                let vary = |channel: usize| 0.012 * (2.3 * f64::from(i) + 1.9 * channel as f64).sin();
                (std::array::from_fn(|channel| light * color[channel] + vary(channel)), 1.0)
            })
        };
        let purple = (0..8).map(|i| ([0.42 + 0.006 * f64::from(i), 0.25, 0.7], 0.4));
        shaded.into_iter().flat_map(shades).chain(purple).collect()
    }

    fn noisy(colors: &[Weighted], seed: u32) -> Vec<Weighted> {
        let factor = |i: usize| 1.0 + 0.02 * (f64::from(seed) * 1e3 * (i as f64 + 0.5).sin()).sin();
        colors.iter().enumerate().map(|(i, (color, weight))| (*color, weight * factor(i))).collect()
    }

    /// Returns the largest distance in Oklab from a color of a palette to the nearest of the other.
    fn moved(a: &Palette, b: &Palette) -> f64 {
        let place = |color: &[f64; 3]| oklab(DVec3::from(*color));
        let nearest = |a: &[f64; 3]| b.colors.iter().map(|b| place(a).distance(place(b))).fold(f64::INFINITY, f64::min);
        a.colors.iter().map(nearest).fold(0.0, f64::max)
    }

    /// The small part has a tone of its own, grays have no tint, and no hue is off.
    #[test]
    fn small_distinct_parts_are_kept() {
        let (palette, errors) = extract(32, &materials(), ColorCount::Usual);
        assert!((8..=ColorCount::MOST_TONES).contains(&palette.colors.len()), "{}", palette.colors.len());
        let purple = chroma(DVec3::new(0.44, 0.25, 0.7));
        let nearest = |color: &[f64; 3]| chroma(DVec3::from(*color)).distance(purple);
        assert!(palette.colors.iter().any(|color| nearest(color) < 0.02), "{palette:?}");
        assert!(errors.hue < 1e-3 && errors.rmse < 0.04, "{errors:?}");
    }

    /// Grays of all tints, as noise and borders between materials make them, are shown as grays, beside vivid colors
    /// and a wood that hardly has more chroma than they have.
    #[test]
    fn neutrals_stay_neutral() {
        let spiral = (0..600).map(|i| {
            let (lightness, turn) = (0.25 + 0.6 * f64::from(i) / 600.0, 2.4 * f64::from(i));
            let tint = 0.02 * (f64::from(i) * 0.37).sin();
            let at = DVec3::new(lightness, tint * turn.cos(), tint * turn.sin());
            (from_oklab(at).to_array(), 1.0)
        });
        let wood = (0..200).map(|i| {
            let light = 0.4 + 0.6 * f64::from(i) / 200.0;
            (from_oklab(light * DVec3::new(0.7, 0.015, 0.06)).to_array(), 1.0)
        });
        let colors: Vec<Weighted> = materials().into_iter().chain(spiral.clone()).chain(wood).collect();
        let (palette, _) = extract(32, &colors, ColorCount::Usual);
        let tinted = spiral.clone().filter(|(color, _)| {
            let shown = PaletteLabel::nearest((*color).into(), &palette, 1).unwrap();
            chroma(DVec3::from(palette.colors[shown.index])).distance(chroma(DVec3::from(*color))) > 0.03
        });
        assert!(tinted.count() <= 12, "{palette:?}");
    }

    /// Tones are the colors that are seen, not those of the leaves that add up to them.
    #[test]
    fn tones_are_what_is_seen() {
        let (red, blue) = (DVec3::new(0.9, 0.2, 0.2), DVec3::new(0.2, 0.2, 0.9));
        let settings = BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, ..Default::default() };
        let density = |at: DVec3| if at.length() < 0.8 { 6.0 } else { 0.0 };
        let is_red = |at: DVec3| ((at + 1.0) * 32.0).floor().element_sum().rem_euclid(2.0) < 1.0;
        let field = bake(&settings, density, |at: DVec3| move |_| if is_red(at) { red } else { blue }).unwrap();
        let settings = ExtractionSettings { method: PaletteMethod::Tones, ..Default::default() };
        let found = crate::palette::extract(&field, &settings, &Progress::default()).unwrap().palette;
        let seen = oklab(0.5 * (red + blue));
        for (color, weight) in found.colors.iter().zip(&found.weights) {
            assert!(oklab(DVec3::from(*color)).distance(seen) < 0.1 || *weight < 0.02, "{found:?}");
        }
    }

    /// Returns the tones of a lit ball with a red cap, white spots and a green foot, and of its noisy leaves.
    fn of_ball(depth: u32, noise: f64) -> Palette {
        let settings = BakeSettings { depth, basis: Basis::Rgba, directions: 1, ..Default::default() };
        let density = |at: DVec3| if at.length() < 0.8 { 1e3 } else { 0.0 };
        let field = bake(&settings, density, |at: DVec3| {
            let spot = (at * 4.0).fract_gl().distance(DVec3::splat(0.5)) < 0.35;
            let color = match (at.z > -0.2, spot) {
                (true, true) => DVec3::new(0.9, 0.89, 0.87),
                (true, false) => DVec3::new(0.85, 0.15, 0.15),
                (false, _) => DVec3::new(0.3, 0.6, 0.2),
            };
            let light = 0.65 + 0.35 * at.normalize_or_zero().dot(DVec3::new(0.6, 0.0, 0.8));
            let off = (at * 7919.0).map(f64::sin).yzx() * 1e3;
            move |_| light * color + noise * off.map(f64::sin)
        });
        crate::palette::extract(&field.unwrap(), &ExtractionSettings::default(), &Progress::default()).unwrap().palette
    }

    /// One percent of noise, and cells of half the size, leave about as many tones of a field in about the same places.
    #[test]
    fn tones_of_a_field_are_steady() {
        let palette = of_ball(6, 0.0);
        assert!(palette.colors.len() >= 8, "{palette:?}");
        for (depth, noise) in [(6, 0.01), (7, 0.0)] {
            let other = of_ball(depth, noise);
            let (tones, expected) = (other.colors.len(), palette.colors.len());
            let moved = moved(&palette, &other).max(moved(&other, &palette));
            assert!(tones.abs_diff(expected) <= 3 && moved < 0.1, "{depth} {noise}: {tones} of {expected}, {moved}");
        }
    }

    /// One percent of noise, and histograms of half as many bins per channel, leave about as many tones in about the
    /// same places. The same bins give the same bits.
    #[test]
    fn noise_and_resolution_move_tones_little() {
        let (palette, _) = extract(32, &materials(), ColorCount::Usual);
        assert_eq!(extract(32, &materials(), ColorCount::Usual).0, palette);
        for seed in 1..=3 {
            let (other, _) = extract(32, &noisy(&materials(), seed), ColorCount::Usual);
            assert_eq!(other.colors.len(), palette.colors.len());
            assert!(moved(&palette, &other).max(moved(&other, &palette)) < 0.02, "{seed}");
        }
        let (fine, _) = extract(64, &materials(), ColorCount::Usual);
        assert!(fine.colors.len().abs_diff(palette.colors.len()) <= 2);
        let shown = |palette| ColorErrors::of_labels(&Histograms::of(32, &materials()), palette, 1).rmse;
        assert!(shown(&fine) < 1.1 * shown(&palette));
        assert!(moved(&palette, &fine).max(moved(&fine, &palette)) < 0.1);
    }

    /// A lower tolerance takes more tones, and what settings ask for is met.
    #[test]
    fn counts_and_tolerances_are_met() {
        let mut before = 0;
        for tolerance in [0.1, 0.06, 0.04] {
            let (palette, errors) = extract(32, &materials(), ColorCount::Auto { tolerance });
            assert!(errors.rmse <= tolerance && palette.colors.len() >= before, "{tolerance}: {errors:?}");
            before = palette.colors.len();
        }
        for count in [1, 3, 17, 64] {
            assert_eq!(extract(32, &materials(), ColorCount::Fixed(count)).0.colors.len(), count);
        }
    }

    /// Colors within a tolerance keep the hue of a few dim parts in the dark, whose channels are hardly off without.
    #[test]
    fn tolerances_bound_hues() {
        let dark = (0..200).map(|i| ([f64::from(i) / 1000.0; 3], 1.0));
        let dim = [[0.22, 0.16, 0.23], [0.19, 0.2, 0.12], [0.14, 0.2, 0.22]].into_iter().flat_map(|color: [f64; 3]| {
            (0..20).map(move |i| (color.map(|channel| (0.8 + 0.02 * f64::from(i)) * channel), 0.2))
        });
        let colors: Vec<Weighted> = dark.chain(dim).collect();
        let (palette, errors) = extract(64, &colors, ColorCount::AUTO);
        assert!(errors.hue < 0.05, "{errors:?} {palette:?}");
    }

    /// Weights may be so large that their sum is infinite, or so small that their squares vanish.
    #[test]
    fn the_scale_of_weights_does_not_matter() {
        let (palette, _) = extract(32, &materials(), ColorCount::Usual);
        for scale in [1e305, 1e-300] {
            let scaled: Vec<_> = materials().into_iter().map(|(color, weight)| (color, scale * weight)).collect();
            assert!(moved(&palette, &extract(32, &scaled, ColorCount::Usual).0) < 1e-6);
        }
    }

    proptest! {
        /// A few flat colors, such as of voxel art, are all found, wherever they are.
        #[test]
        fn flat_colors_are_exact(
            colors in prop::collection::btree_set(prop::array::uniform3(0..16u8), 1..12),
            weights in prop::array::uniform12(0.01..1.0f64),
        ) {
            let center = |i: u8| (2.0 * f64::from(i) + 0.5) / 32.0;
            let colors: Vec<Weighted> = colors.into_iter().map(|c| c.map(center)).zip(weights).collect();
            let (palette, errors) = extract(32, &colors, ColorCount::Fixed(12));
            prop_assert_eq!(palette.colors.len(), colors.len());
            prop_assert!(errors.rmse < 1e-6, "{errors:?}");
        }
    }
}
