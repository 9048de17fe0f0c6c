//! Extreme palettes and `Posterize` settings.

use bevy::prelude::*;
use bevy_plenoctree::{
    Activation, BilateralFilter, EdgeSmoothing, FieldPalette, Palette, PaletteOverride, PlenOctree, Posterize, Prop,
    UpAxis,
};
use glam::DVec3;
use half::f16;
use plenoctree::{BakeSettings, Basis, bake, camera::PinholeCamera, reference};

use super::stage::{Alone, looking};
use crate::stage::{
    fields::{activated, eight},
    pixels::{assert_near, is_off},
};

fn ball() -> PlenOctree {
    let settings = BakeSettings {
        depth: 4,
        min: DVec3::NEG_ONE,
        max: DVec3::ONE,
        basis: Basis::Sh1,
        up: UpAxis::Y,
        ..Default::default()
    };
    let density = |at: DVec3| (30.0 * (0.8 - at.length())).clamp(0.0, 12.0);
    bake(&settings, density, |at| move |_: DVec3| 0.5 + 0.4 * (4.0 * at).map(f64::sin)).unwrap()
}

fn camera() -> PinholeCamera {
    looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO)
}

#[test]
fn palettes_and_settings_at_their_limits() {
    let field = ball();
    let rendering = reference::render(&field, &camera());
    let gray = [0.4; 3];
    let many: Vec<[f64; 3]> = (0..16u32).map(|i| [i & 3, i >> 2 & 1, i >> 3].map(|c| f64::from(c) / 3.0)).collect();
    let mut stage = Alone::new(&field);
    for (name, colors) in [
        ("one", vec![gray]),
        ("equal", vec![gray, gray, gray]),
        ("two", vec![[0.9, 0.1, 0.1], [0.1, 0.2, 0.9]]),
        ("sixteen", many),
    ] {
        let source: Vec<DVec3> = colors.iter().map(|color| DVec3::from(*color)).collect();
        let palette = Palette::new(colors).unwrap();
        stage.paint(FieldPalette::new(palette.clone()));
        for (blend_steps, softness) in [(1, 0.0), (8, 0.0), (1, 1e-9), (8, 0.2), (3, 10.0)] {
            let posterize = Posterize { blend_steps, softness, edges: EdgeSmoothing::Off, ..Posterize::paper() };
            let settings = reference::Posterization { blend_steps, softness: softness.into(), ..Default::default() };
            stage.dress(posterize);
            let expected = reference::posterize(&rendering, DVec3::ZERO, &palette, &source, &settings);
            let frame = stage.see(&camera());
            let pixels = frame.pixels().zip(&expected).zip(&rendering.opacity);
            // The background is easy.
            let object: Vec<_> = pixels.filter(|(_, opacity)| **opacity > 0.0).map(|(pixel, _)| pixel).collect();
            let wrong = object.iter().filter(|(pixel, color)| is_off(pixel, **color, 2.0)).count();
            // Half floats move single pixels across the border between two labels.
            assert!(
                object.len() > 150 && wrong * 100 <= object.len(),
                "{name}, {posterize:?}: {wrong} of {}",
                object.len()
            );
        }
    }
}

/// A palette of 64 colors has more than 14,000 labels with eight blend steps. That is too many to compare to every
/// pixel, so the palette is drawn without blends.
#[test]
fn a_palette_with_too_many_labels_has_fewer_blends() {
    let field = ball();
    let rendering = reference::render(&field, &camera());
    let mut stage = Alone::new(&field);
    for (count, steps) in [(64u32, 1), (32, 3)] {
        let colors = (0..count).map(|i| [i & 3, i >> 2 & 3, i >> 4].map(|c| f64::from(c) / 3.0 * 0.9 + 0.05));
        let palette = Palette::new(colors.collect()).unwrap();
        let source: Vec<DVec3> = palette.colors.iter().map(|color| DVec3::from(*color)).collect();
        stage.paint(FieldPalette::new(palette.clone()));
        let posterize = Posterize { blend_steps: 8, softness: 0.0, edges: EdgeSmoothing::Off, ..Posterize::paper() };
        stage.dress(posterize);
        let frame = stage.see(&camera());
        let share = |blend_steps| {
            let settings = reference::Posterization { blend_steps, softness: 0.0, ..Default::default() };
            let expected = reference::posterize(&rendering, DVec3::ZERO, &palette, &source, &settings);
            let owned = frame.pixels().zip(&expected).zip(&rendering.opacity).filter(|(_, opacity)| **opacity > 0.4);
            let all = owned.clone().count();
            assert!(all > 100);
            owned.filter(|((pixel, color), _)| !is_off(pixel, **color, 2.0)).count() as f64 / all as f64
        };
        assert!(share(steps) > 0.97 && share(8) < 0.5, "{count} colors: {}, {}", share(steps), share(8));
    }
}

/// Colors outside the gamut of displays are valid, and are clamped when drawn.
#[test]
fn neon_colors_are_clamped() {
    let field = ball();
    let mut stage = Alone::with_palette(&field, Palette::new(vec![[0.4; 3]]).unwrap());
    stage.dress(Posterize::default());
    for (color, expected) in
        [(Color::srgb(3.0, -1.0, 0.5), [255, 0, 128]), (Color::linear_rgb(1e4, 0.0, -1e4), [255, 0, 0])]
    {
        stage.palette().set(0, color);
        let [red, green, blue] = expected;
        assert_near(stage.middle(&camera()), Color::srgb_u8(red, green, blue), 1, &format!("{color:?}"));
    }
}

/// Among more props than half floats can count, the nearest one has its own color.
#[test]
fn the_nearest_of_two_thousand_props_has_its_colors() {
    let solid = eight(Basis::Rgba, 1e4, &[f16::ZERO; 3]);
    let mut stage = Alone::with_palette(&solid, Palette::new(vec![[0.0; 3]]).unwrap());
    let (own, field) = (Color::srgb(0.2, 0.4, 0.8), stage.field());
    stage.dress((Posterize::default(), PaletteOverride::default().with(0, own)));
    for index in 1..=2100 {
        let behind = camera().position.normalize().as_vec3() * -0.01 * index as f32;
        stage.spawn((Prop(field.clone()), Transform::from_translation(behind)));
    }
    assert_near(stage.middle(&camera()), own, 1, "the nearest");
}

/// A prop of one color is drawn in that color, whatever its settings.
#[test]
fn settings_beyond_their_range_are_harmless() {
    let solid = eight(Basis::Rgba, 1e4, &[0.25, 0.5, 1.0].map(f16::from_f32));
    let mut stage = Alone::with_palette(&solid, Palette::new(vec![[0.0; 3], [0.25, 0.5, 1.0], [1.0; 3]]).unwrap());
    let floats = [f32::NAN, f32::NEG_INFINITY, -1.0, 0.0, f32::INFINITY].into_iter().flat_map(|number| {
        let filter = BilateralFilter::default();
        [
            Posterize { softness: number.min(0.2), ..default() },
            Posterize { min_opacity: number.min(1.0), ..default() },
            Posterize { filter: BilateralFilter { spatial_sigma: number, ..filter }, ..default() },
            Posterize { filter: BilateralFilter { range_sigma: number, ..filter }, ..default() },
        ]
    });
    let counts = [0, u32::MAX].into_iter().flat_map(|number| {
        let filter = BilateralFilter::default();
        [
            Posterize { blend_steps: number, softness: 0.0, ..default() },
            Posterize { filter: BilateralFilter { iterations: number, ..filter }, ..default() },
            Posterize { filter: BilateralFilter { radius: number, ..filter }, ..default() },
            Posterize { filter: BilateralFilter { taps: number, ..filter }, ..default() },
        ]
    });
    for posterize in floats.chain(counts) {
        stage.dress(posterize);
        assert_near(stage.middle(&camera()), Color::srgb(0.25, 0.5, 1.0), 1, &format!("{posterize:?}"));
    }
}

/// Sums of harmonics beyond the limits of half floats get the nearest colors of the palette.
#[test]
fn the_brightest_and_the_darkest_get_labels() {
    let (black, white) = ([0.0; 3], [1.0; 3]);
    for (value, expected) in [(f16::MAX, [255; 3]), (f16::MIN, [0; 3])] {
        // The constant and the three functions that are linear in the direction have one sign, seen from the camera.
        let leaf = [value, value, -value, value].repeat(3);
        let field = activated(&eight(Basis::Sh4, 30.0, &leaf), Activation::Identity);
        // The wrong color comes first.
        let colors = if value == f16::MAX { vec![black, white] } else { vec![white, black] };
        let mut stage = Alone::with_palette(&field, Palette::new(colors).unwrap());
        stage.dress(Posterize { softness: 0.0, ..default() });
        assert_eq!(stage.middle(&camera()), expected, "{value}");
    }
}
