//! Properties of ramps.

use glam::DVec3;
use proptest::prelude::*;

use super::{soft::shares, *};
use crate::{
    bake::{BakeSettings, bake},
    field::{Basis, PlenOctree},
    palette::{PaletteLabel, oklab::oklab},
    sampling::{Canceled, Progress, SamplingSettings, ViewRays},
};

fn place(color: [f64; 3]) -> DVec3 {
    oklab(color.into())
}

/// Red, gray and green in four shades each, from dark to light, and a purple.
fn palette() -> Palette {
    let shades = |color: [f64; 3]| (1..=4).map(move |i| color.map(|c: f64| c * (0.25 + 0.18 * f64::from(i))));
    let materials = [[0.85, 0.15, 0.15], [0.9, 0.9, 0.88], [0.3, 0.6, 0.2]];
    let mut colors: Vec<[f64; 3]> = materials.into_iter().flat_map(shades).collect();
    colors.push([0.45, 0.25, 0.7]);
    let mut palette = Palette::new(colors).unwrap();
    palette.weights = (1..=13).map(|i| 1.0 / f64::from(i)).collect();
    palette.ramps = palette.guess_ramps();
    palette
}

fn shown(palette: &Palette, ramp: usize, adjustment: &RampAdjustment) -> Vec<[f64; 3]> {
    let mut colors = palette.colors.clone();
    palette.show_ramp(ramp, adjustment, |tone, color| colors[tone] = color).unwrap();
    colors
}

/// Returns the ramps that the colors of a palette form in a field.
fn ramps_in(field: &PlenOctree, palette: &Palette) -> Vec<Ramp> {
    let rays = ViewRays::all(field, &SamplingSettings::default());
    palette.ramps_in_views(&View::all(field, &rays, &Progress::default()).unwrap())
}

/// Returns how much a color in encoded sRGB belongs to each ramp, from 0 to 1.
fn ramp_weights(palette: &Palette, color: [f64; 3]) -> Vec<f64> {
    let mut weights = vec![0.0; palette.ramps.len()];
    shares(palette, color, |tone, share| {
        if let Some(ramp) = palette.ramp_of(tone) {
            weights[ramp] += share;
        }
    });
    weights
}

/// Returns the weighted mean of a ramp's tones in Oklab.
fn mean(palette: &Palette, ramp: usize, colors: &[[f64; 3]]) -> DVec3 {
    let tones = &palette.ramps[ramp].tones;
    let weight: f64 = tones.iter().map(|&tone| palette.weights[tone]).sum();
    tones.iter().map(|&tone| palette.weights[tone] * place(colors[tone])).sum::<DVec3>() / weight
}

#[test]
fn shades_of_a_material_are_one_ramp() {
    let palette = palette();
    let tones: Vec<_> = palette.ramps.iter().map(|ramp| ramp.tones.clone()).collect();
    assert_eq!(tones, [vec![0, 1, 2, 3], vec![4, 5, 6, 7], vec![8, 9, 10, 11], vec![12]]);
    let names: Vec<_> = palette.ramps.iter().map(|ramp| ramp.name.as_str()).collect();
    assert_eq!(names, ["red", "gray", "green", "purple"]);
    assert_eq!(palette.validate(), Ok(()));
}

/// Handmade palettes may have no weights: then all colors count the same.
#[test]
fn ramps_need_no_weights() {
    let mut palette = palette();
    palette.weights = Vec::new();
    palette.ramps = palette.guess_ramps();
    let even = Palette { weights: vec![1.0; 13], ..palette.clone() };
    let adjustment = RampAdjustment::to_color([0.1, 0.2, 0.8]);
    for ramp in 0..palette.ramps.len() {
        let [found, expected] = [&palette, &even].map(|palette| shown(palette, ramp, &adjustment));
        assert!(found.iter().zip(&expected).all(|(a, b)| place(*a).distance(place(*b)) < 1e-9), "{found:?}");
    }
}

/// A shadow whose tint is that of neither material belongs to the one that it is seen on.
#[test]
fn borders_tell_whose_shadow_it_is() {
    let (tan, slate, shadow) = ([0.76, 0.66, 0.52], [0.36, 0.46, 0.58], [0.36, 0.35, 0.35]);
    let mut palette = Palette::new(vec![tan, slate, shadow]).unwrap();
    let settings = BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, ..Default::default() };
    for owner in [0, 1] {
        // Two balls, side by side. One of them is in shadow on the right.
        let ball = |at: DVec3| if at.x < 0.0 { 0 } else { 1 };
        let center = |ball: usize| DVec3::new([-0.5, 0.5][ball], 0.0, 0.0);
        let density = |at: DVec3| if at.distance(center(ball(at))) < 0.35 { 1e3 } else { 0.0 };
        let color = |at: DVec3| {
            let own = ball(at);
            let is_shadow = own == owner && at.y > 0.0;
            move |_| DVec3::from(if is_shadow { shadow } else { [tan, slate][own] })
        };
        let field = bake(&settings, density, color).unwrap();
        palette.ramps = ramps_in(&field, &palette);
        assert_eq!(palette.ramp_of(2), palette.ramp_of(owner), "{:?}", palette.ramps);
        assert_ne!(palette.ramp_of(0), palette.ramp_of(1), "{:?}", palette.ramps);
    }
}

/// Returns a ball with a color at each place.
fn ball(color: impl Fn(DVec3) -> [f64; 3] + Sync) -> PlenOctree {
    let settings = BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, ..Default::default() };
    let density = |at: DVec3| if at.length() < 0.8 { 1e3 } else { 0.0 };
    bake(&settings, density, |at: DVec3| {
        let color = DVec3::from(color(at));
        move |_| color
    })
    .unwrap()
}

/// Two materials that are all there is border only each other, which does not make them one, however many shades they
/// have.
#[test]
fn neighbors_are_not_one_material() {
    let (yellow, tan) = (DVec3::new(0.16, 0.03, 0.14), DVec3::new(0.16, 0.01, 0.05));
    for shades in 1..=6 {
        let shade = |of: DVec3, i: usize| {
            let light = 1.0 + 4.0 * (i as f64 + 0.5) / shades as f64;
            crate::palette::oklab::from_oklab(light * of).to_array()
        };
        let colors = [yellow, tan].into_iter().flat_map(|of| (0..shades).map(move |i| shade(of, i))).collect();
        let mut palette = Palette::new(colors).unwrap();
        let index = |at: DVec3| {
            let lit = ((0.5 + 0.6 * at.z) * shades as f64).clamp(0.0, shades as f64 - 1.0) as usize;
            if (4.0 * at.x).sin() * (4.0 * at.y).sin() > 0.0 { lit } else { shades + lit }
        };
        let field = ball(|at| palette.colors[index(at)]);
        palette.ramps = ramps_in(&field, &palette);
        for tone in 0..2 * shades {
            assert_eq!(palette.ramp_of(tone), palette.ramp_of(tone / shades * shades), "{:?}", palette.ramps);
        }
        assert_ne!(palette.ramp_of(0), palette.ramp_of(shades), "{:?}", palette.ramps);
    }
}

/// The light and the dark of small flowers are one ramp, although no tone is between them.
#[test]
fn small_parts_are_one_ramp() {
    let colors = [[0.25, 0.55, 0.15], [0.15, 0.35, 0.1], [0.49, 0.32, 0.7], [0.28, 0.18, 0.47]];
    let mut palette = Palette::new(colors.to_vec()).unwrap();
    palette.weights = vec![0.5, 0.49, 0.004, 0.006];
    let index = |at: DVec3| {
        let petal = (at * 5.0).fract_gl() - 0.5;
        let meadow = if at.z > 0.0 { 0 } else { 1 };
        if petal.length() > 0.2 {
            meadow
        } else if petal.z > 0.0 {
            2
        } else {
            3
        }
    };
    let field = ball(|at| palette.colors[index(at)]);
    palette.ramps = ramps_in(&field, &palette);
    assert_eq!(palette.ramp_of(0), palette.ramp_of(1), "{:?}", palette.ramps);
    assert_eq!(palette.ramp_of(2), palette.ramp_of(3), "{:?}", palette.ramps);
    assert_ne!(palette.ramp_of(0), palette.ramp_of(2), "{:?}", palette.ramps);
}

#[test]
fn any_number_of_threads_finds_the_same_ramps() {
    let settings = BakeSettings { depth: 5, basis: Basis::Rgba, directions: 1, ..Default::default() };
    let density = |at: DVec3| 50.0 * (0.9 - at.length()).max(0.0);
    let field = bake(&settings, density, |at: DVec3| move |_| 0.5 + 0.4 * (5.0 * at).map(f64::sin)).unwrap();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ramps_in(&field, &palette()))
    };
    assert_eq!(on(1), on(4));
    let progress = Progress::default();
    progress.cancel();
    assert_eq!(View::all(&field, &ViewRays::all(&field, &SamplingSettings::default()), &progress), Err(Canceled));
}

proptest! {
    /// Every color is in one ramp, and every ramp goes from shadow to highlight.
    #[test]
    fn any_palette_has_ramps(colors in prop::collection::vec(prop::array::uniform3(0.0..=1.0f64), 1..=64)) {
        let mut palette = Palette::new(colors).unwrap();
        palette.ramps = palette.guess_ramps();
        prop_assert_eq!(palette.validate(), Ok(()));
        prop_assert!((0..palette.colors.len()).all(|tone| palette.ramp_of(tone).is_some()));
        for ramp in &palette.ramps {
            prop_assert!(ramp.tones.is_sorted_by_key(|tone| place(palette.colors[*tone]).x));
        }
    }

    /// Edits keep palettes valid and lose no tone. Those that fail change nothing.
    #[test]
    fn edits_keep_palettes_valid(edits in prop::collection::vec((0..3u8, 0..15usize, 0..15usize, "[a-c7=]{0,2}"), 0..30)) {
        let mut palette = palette();
        for (kind, first, second, name) in edits {
            let before = palette.clone();
            let done = match kind {
                0 => palette.gather_tones(&[first, second], name),
                1 => palette.move_tone(first, second),
                _ => palette.rename_ramp(first, name),
            };
            prop_assert!(done.is_ok() || palette == before);
            prop_assert_eq!(palette.validate(), Ok(()));
            prop_assert!((0..13).all(|tone| palette.ramp_of(tone).is_some()));
            prop_assert!(palette.ramps.iter().all(|r| r.tones.is_sorted_by_key(|t| place(palette.colors[*t]).x)));
        }
    }

    /// The mean of a ramp becomes any color that leaves it room, and light and dark stay as far apart. The others stay.
    #[test]
    fn ramps_become_colors(ramp in 0..4usize, lightness in 0.45..0.6f64, hue in 0.0..std::f64::consts::TAU, chroma in 0.0..0.05f64) {
        let palette = palette();
        let target = DVec3::new(lightness, chroma * hue.cos(), chroma * hue.sin());
        let color = crate::palette::oklab::from_oklab(target).into();
        let colors = shown(&palette, ramp, &RampAdjustment::to_color(color));
        prop_assert!(mean(&palette, ramp, &colors).distance(target) < 2e-3, "{target} {colors:?}");
        let difference = |colors: &[[f64; 3]], i: usize, j: usize| place(colors[i]).x - place(colors[j]).x;
        let tones = &palette.ramps[ramp].tones;
        for pair in tones.windows(2) {
            let [before, after] = [&palette.colors, &colors].map(|colors| difference(colors, pair[1], pair[0]));
            prop_assert!((before - after).abs() < 0.02, "{before} {after}");
        }
        prop_assert!((0..13).all(|tone| tones.contains(&tone) || colors[tone] == palette.colors[tone]));
    }

    /// Whatever a ramp becomes, it stays on the screen and keeps its order and at least three quarters of its contrast.
    #[test]
    fn ramps_keep_their_shape(ramp in 0..4usize, color in prop::array::uniform3(0.0..=1.0f64)) {
        let palette = palette();
        for color in [color, [0.0; 3], [0.5; 3], [1.0; 3]] {
            let colors = shown(&palette, ramp, &RampAdjustment::to_color(color));
            prop_assert!(colors.as_flattened().iter().all(|channel| (0.0..=1.0).contains(channel)));
            for pair in palette.ramps[ramp].tones.windows(2) {
                let [before, after] =
                    [&palette.colors, &colors].map(|colors| place(colors[pair[1]]).x - place(colors[pair[0]]).x);
                prop_assert!(after > 0.74 * before && after < 1.01 * before, "{color:?}: {before} {after}");
            }
        }
    }

    /// A ramp that becomes its own color does not change, and neither does one without adjustments, to the bit.
    #[test]
    fn ramps_can_stay(ramp in 0..4usize) {
        let palette = palette();
        let own = palette.ramp_color(ramp).unwrap();
        let colors = shown(&palette, ramp, &RampAdjustment::to_color(own));
        for (a, b) in colors.iter().zip(&palette.colors) {
            prop_assert!(DVec3::from(*a).distance(DVec3::from(*b)) < 1e-6);
        }
        prop_assert_eq!(&shown(&palette, ramp, &RampAdjustment::default()), &palette.colors);
    }

    /// One wish for each of some ramps comes true to the bit, whatever the colors.
    #[test]
    fn single_wishes_come_true(colors in prop::array::uniform3(prop::array::uniform3(0.0..=1.0f64)), tone in 0..4usize) {
        let palette = palette();
        let wishes: Vec<Wish> = (0..3).map(|ramp| Wish::tone(4 * ramp + tone, colors[ramp])).collect();
        let shown = palette.recolored(&palette.colors, &wishes, &[]).unwrap();
        prop_assert!((0..3).all(|ramp| shown[4 * ramp + tone] == colors[ramp]));
        prop_assert_eq!(shown[12], palette.colors[12]);
        prop_assert!(shown.as_flattened().iter().all(|channel| (0.0..=1.0).contains(channel)));
    }

    /// Two wishes for the dark and the light end of a ramp come true if they do not swap light and dark.
    #[test]
    fn both_ends_of_a_ramp_can_be_wished(dark in prop::array::uniform3(0.1..0.4f64), light in prop::array::uniform3(0.6..0.9f64)) {
        let palette = palette();
        let shown = palette.recolored(&palette.colors, &[Wish::tone(0, dark), Wish::tone(3, light)], &[]).unwrap();
        prop_assert!(shown[0] == dark && shown[3] == light);
        prop_assert!(palette.ramps[0].tones.is_sorted_by_key(|tone| place(shown[*tone]).x));
    }

    /// A blend of two labels gets its color when only one of its ramps may move.
    #[test]
    fn blends_can_be_wished(color in prop::array::uniform3(0.35..0.6f64)) {
        let palette = palette();
        let label = PaletteLabel { index: 0, first: 2, second: 6, share: 2.0 / 3.0 };
        let shown = palette.recolored(&palette.colors, &[Wish { label, color }], &[1]).unwrap();
        prop_assert!((label.mix(&shown) - DVec3::from(color)).abs().max_element() < 1e-3);
        prop_assert_eq!(&shown[4..8], &palette.colors[4..8]);
    }
}

/// Brightness, contrast and saturation do what they say.
#[test]
fn adjustments_act_on_their_own() {
    let palette = palette();
    let of = |adjustment: RampAdjustment| shown(&palette, 0, &adjustment);
    let spread = |colors: &[[f64; 3]]| place(colors[3]).x - place(colors[0]).x;
    let before = mean(&palette, 0, &palette.colors);
    let flat = of(RampAdjustment { contrast: 0.0, ..Default::default() });
    assert!(spread(&flat).abs() < 1e-6);
    let gray = of(RampAdjustment { saturation: 0.0, ..Default::default() });
    assert!(gray[..4].iter().all(|color| place(*color).y.hypot(place(*color).z) < 1e-6));
    assert!((spread(&gray) - spread(&palette.colors)).abs() < 1e-6);
    let bright = of(RampAdjustment { brightness: 0.1, ..Default::default() });
    assert!((mean(&palette, 0, &bright).x - before.x - 0.1).abs() < 1e-6);
    let neon = of(RampAdjustment::to_color([0.2, 2.5, 0.4]));
    assert!(neon[..4].iter().any(|color| color[1] > 1.5), "{neon:?}");
    for broken in [f64::NAN, f64::INFINITY] {
        let adjustment = RampAdjustment { brightness: broken, contrast: broken, saturation: broken, color: None };
        assert_eq!(of(adjustment), palette.colors);
        assert_eq!(of(RampAdjustment::to_color([0.2, broken, 0.4])), palette.colors);
    }
    assert!(palette.show_ramp(4, &RampAdjustment::default(), |_, _| ()).is_err());
}

/// Errors say which wishes are not met and why, and come with the colors in between.
#[test]
fn wishes_that_contradict_are_named() {
    let palette = palette();
    let (red, blue, gray) = ([0.8, 0.1, 0.1], [0.1, 0.1, 0.8], [0.5; 3]);
    let wishes =
        [Wish::tone(0, red), Wish::tone(5, gray), Wish::tone(0, blue), Wish::tone(8, gray), Wish::tone(99, red)];
    let wishes = [&wishes[..], &[Wish::tone(1, [f64::NAN; 3])]].concat();
    let error = palette.recolored(&palette.colors, &wishes, &[2]).unwrap_err();
    let reasons: Vec<_> = error.unmet.iter().map(|unmet| (unmet.wish, unmet.reason)).collect();
    let expected = [
        (0, UnmetReason::Conflict),
        (2, UnmetReason::Conflict),
        (3, UnmetReason::Locked),
        (4, UnmetReason::NoLabel { index: 99, colors: palette.colors.len() }),
        (5, UnmetReason::NotFinite),
    ];
    assert_eq!(reasons, expected);
    // In least squares, halfway in Oklab.
    let middle = 0.5 * (place(red) + place(blue));
    assert!(place(error.nearest[0]).distance(middle) < 0.02, "{error:?}");
    assert_eq!(error.nearest[5], gray);
    assert!(error.to_string().contains("wish 3 cannot be met: its colors are in no ramp that may move"), "{error}");
    assert!(
        error.to_string().ends_with("wish 5 cannot be met: found a color or a share that is not finite"),
        "{error}"
    );
    assert_eq!(palette.recolored(&palette.colors, &[], &[]), Ok(palette.colors.clone()));
    // A locked label that already has its color needs nothing.
    assert!(palette.recolored(&palette.colors, &[Wish::tone(8, palette.colors[8])], &[2]).is_ok());
}

/// Returns the largest change of membership, in a step so small that a continuous one hardly changes, between two
/// colors: where it changes most.
fn largest_jump(palette: &Palette, mut from: DVec3, mut to: DVec3) -> f64 {
    let change = |a: DVec3, b: DVec3| {
        let [a, b] = [a, b].map(|color| ramp_weights(palette, color.into()));
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for _ in 0..40 {
        let middle = 0.5 * (from + to);
        if change(from, middle) > change(middle, to) { to = middle } else { from = middle }
    }
    change(from, to)
}

proptest! {
    /// Membership is shared out completely, and passes from ramp to ramp without a seam.
    #[test]
    fn membership_is_soft(a in prop::array::uniform3(0.05..1.0f64), b in prop::array::uniform3(0.05..1.0f64)) {
        let palette = palette();
        let weights = ramp_weights(&palette, a);
        prop_assert!(weights.iter().all(|weight| *weight >= 0.0));
        prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        prop_assert!(largest_jump(&palette, a.into(), b.into()) < 1e-6);
    }

    /// Without a change, and where nothing near has changed, colors as trained stay the same bits.
    #[test]
    fn colors_as_trained_stay_where_nothing_changes(color in prop::array::uniform3(-0.1..1.2f64)) {
        let palette = palette();
        prop_assert_eq!(palette.recolored_as_trained(color, &palette.colors), color);
        let shown = shown(&palette, 0, &RampAdjustment::to_color([0.1, 0.3, 0.9]));
        let moves = ramp_weights(&palette, color)[0] > 0.0;
        prop_assert_eq!(palette.recolored_as_trained(color, &shown) != color, moves);
    }
}

/// Colors as trained move with their ramp, and keep their differences.
#[test]
fn colors_as_trained_move_with_their_ramp() {
    let palette = palette();
    let wish = [0.2, 0.6, 0.5];
    let purple = palette.colors[12];
    let shown = shown(&palette, 3, &RampAdjustment::to_color(wish));
    let moved = place(palette.recolored_as_trained(purple, &shown));
    assert!(moved.distance(place(wish)) < 1e-6, "{moved}");
    let near = [purple[0] + 0.01, purple[1], purple[2] - 0.01];
    let apart = place(palette.recolored_as_trained(near, &shown)) - moved;
    assert!(apart.distance(place(near) - place(purple)) < 1e-6, "{apart}");
}

/// Colors that may not move keep what they show, to the bit, also if a wish is nearly what they show.
#[test]
fn locked_colors_stay_near_wishes() {
    let palette = palette();
    let near = palette.colors[0].map(|channel| channel + 5e-4);
    let locked = palette.ramp_of(0).unwrap();
    assert_eq!(palette.recolored(&palette.colors, &[Wish::tone(0, near)], &[locked]).unwrap(), palette.colors);
    assert_eq!(palette.recolored(&palette.colors, &[Wish::tone(0, near)], &[]).unwrap()[0], near);
    let without = Palette { ramps: vec![], ..palette };
    assert_eq!(without.recolored(&without.colors, &[Wish::tone(0, near)], &[]).unwrap(), without.colors);
}

/// Palettes whose parts do not fit each other are no reason to panic: colors without a weight have none, and tones
/// without a color stay last.
#[test]
fn parts_need_not_fit_each_other() {
    let colors = vec![[0.5, 0.1, 0.1], [0.2, 0.0, 0.0], [0.9, 0.9, 0.9]];
    let ramp = |name: &str, tones: &[usize]| Ramp { name: name.into(), tones: tones.to_vec() };
    let ramps = vec![ramp("red", &[9, 0]), ramp("gray", &[2])];
    let unfit = Palette { weights: vec![], ramps, ..Palette::new(colors).unwrap() };
    let guessed: usize = unfit.guess_ramps().iter().map(|ramp| ramp.tones.len()).sum();
    assert_eq!((guessed, unfit.ramps_in_views(&[]).len()), (3, unfit.guess_ramps().len()));
    let mut palette = unfit.clone();
    palette.move_tone(1, 0).unwrap();
    assert_eq!(palette.ramps[0].tones, [1, 0, 9]);
    palette.gather_tones(&[2], "red").unwrap();
    assert_eq!(palette.ramps[0].tones, [1, 0, 2, 9]);
    let mut palette = unfit;
    palette.gather_tones(&[1, 2], "red").unwrap();
    assert_eq!(palette.ramps[0].tones, [1, 0, 2, 9]);
}
