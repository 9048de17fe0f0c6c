//! Extreme palettes and `Posterize` settings.

use bevy::prelude::*;
use bevy_plenoctree::{
    Activation, BilateralFilter, EdgeSmoothing, Palette, PaletteOverride, Palettes, Posterize, Prop, UpAxis,
};
use glam::DVec3;
use half::f16;
use plenoctree::{BakeSettings, Basis, Cell, bake, camera::PinholeCamera, reference};

use super::stage::{Stage, activated, field, is_near, looking};

fn ball() -> bevy_plenoctree::PlenOctree {
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
    for (name, colors) in [
        ("one", vec![gray]),
        ("equal", vec![gray, gray, gray]),
        ("two", vec![[0.9, 0.1, 0.1], [0.1, 0.2, 0.9]]),
        ("sixteen", many),
    ] {
        let source: Vec<DVec3> = colors.iter().map(|color| DVec3::from(*color)).collect();
        let mut stage = Stage::with_palette(&field, Palette::new(colors).unwrap());
        for (blend_steps, softness) in [(1, 0.0), (8, 0.0), (1, 1e-9), (8, 0.2), (3, 10.0)] {
            let posterize = Posterize { blend_steps, softness, edges: EdgeSmoothing::Off, ..Posterize::paper() };
            let settings = reference::Posterization { blend_steps, softness: softness.into(), ..Default::default() };
            let prop = stage.prop;
            stage.headless.app.world_mut().entity_mut(prop).insert(posterize);
            let expected = reference::posterize(&rendering, DVec3::ZERO, &source, &source, &settings);
            let is_far = |pixel: &image::Rgba<u8>, color: &DVec3| {
                (0..3).any(|c| (f64::from(pixel[c]) - 255.0 * color[c].clamp(0.0, 1.0)).abs() > 2.0)
            };
            let frame = stage.capture(&camera());
            let pixels = frame.pixels().zip(&expected).zip(&rendering.opacity);
            // The background is easy.
            let object: Vec<_> = pixels.filter(|(_, opacity)| **opacity > 0.0).map(|(pixel, _)| pixel).collect();
            let wrong = object.iter().filter(|(pixel, color)| is_far(pixel, color)).count();
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
    for (count, steps) in [(64u32, 1), (32, 3)] {
        let colors = (0..count).map(|i| [i & 3, i >> 2 & 3, i >> 4].map(|c| f64::from(c) / 3.0 * 0.9 + 0.05));
        let palette = Palette::new(colors.collect()).unwrap();
        let source: Vec<DVec3> = palette.colors.iter().map(|color| DVec3::from(*color)).collect();
        let mut stage = Stage::with_palette(&field, palette);
        let prop = stage.prop;
        let posterize = Posterize { blend_steps: 8, softness: 0.0, edges: EdgeSmoothing::Off, ..Posterize::paper() };
        stage.headless.app.world_mut().entity_mut(prop).insert(posterize);
        let frame = stage.capture(&camera());
        let share = |blend_steps| {
            let settings = reference::Posterization { blend_steps, softness: 0.0, ..Default::default() };
            let expected = reference::posterize(&rendering, DVec3::ZERO, &source, &source, &settings);
            let owned = frame.pixels().zip(&expected).zip(&rendering.opacity).filter(|(_, opacity)| **opacity > 0.4);
            let near = |pixel: &image::Rgba<u8>, color: &DVec3| {
                (0..3).all(|c| (f64::from(pixel[c]) - 255.0 * color[c]).abs() <= 2.0)
            };
            let all = owned.clone().count();
            assert!(all > 100);
            owned.filter(|((pixel, color), _)| near(pixel, color)).count() as f64 / all as f64
        };
        assert!(share(steps) > 0.97 && share(8) < 0.5, "{count} colors: {}, {}", share(steps), share(8));
    }
}

/// Colors outside the gamut of displays are valid, and are clamped when drawn.
#[test]
fn neon_colors_are_clamped() {
    let field = ball();
    let mut stage = Stage::with_palette(&field, Palette::new(vec![[0.4; 3]]).unwrap());
    let (prop, handle) = (stage.prop, stage.field.clone());
    stage.headless.app.world_mut().entity_mut(prop).insert(Posterize::default());
    for (color, expected) in
        [(Color::srgb(3.0, -1.0, 0.5), [255, 0, 128]), (Color::linear_rgb(1e4, 0.0, -1e4), [255, 0, 0])]
    {
        stage.headless.app.world_mut().resource_mut::<Palettes>().get_mut(&handle).unwrap().set(0, color);
        let pixel = *stage.capture(&camera()).get_pixel(16, 16);
        assert!((0..3).all(|c| pixel[c].abs_diff(expected[c]) <= 1), "{color:?}: {pixel:?}");
    }
}

/// Among more props than half floats can count, the nearest one has its own color.
#[test]
fn the_nearest_of_two_thousand_props_has_its_colors() {
    let node = std::array::from_fn(|cell| Cell::leaf(cell as u32));
    let solid = field(Basis::Rgba, vec![node], vec![1e4; 8], vec![f16::ZERO; 24]);
    let mut stage = Stage::with_palette(&solid, Palette::new(vec![[0.0; 3]]).unwrap());
    let (nearest, handle) = (stage.prop, stage.field.clone());
    let world = stage.headless.app.world_mut();
    let mut own = PaletteOverride::default();
    own.set(0, Color::srgb(0.2, 0.4, 0.8));
    world.entity_mut(nearest).insert((Posterize::default(), own));
    for index in 1..=2100 {
        let behind = camera().position.normalize().as_vec3() * -0.01 * index as f32;
        world.spawn((Prop(handle.clone()), Transform::from_translation(behind)));
    }
    let pixel = *stage.capture(&camera()).get_pixel(16, 16);
    assert!(is_near(pixel.0, [51, 102, 204, 255]), "{pixel:?}");
}

/// A prop of one color is drawn in that color, whatever its settings.
#[test]
fn settings_beyond_their_range_are_harmless() {
    let node = std::array::from_fn(|cell| Cell::leaf(cell as u32));
    let colors = [0.25, 0.5, 1.0].map(f16::from_f32).repeat(8);
    let solid = field(Basis::Rgba, vec![node], vec![1e4; 8], colors);
    let mut stage = Stage::with_palette(&solid, Palette::new(vec![[0.0; 3], [0.25, 0.5, 1.0], [1.0; 3]]).unwrap());
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
        ]
    });
    for posterize in floats.chain(counts) {
        let prop = stage.prop;
        stage.headless.app.world_mut().entity_mut(prop).insert(posterize);
        let pixel = *stage.capture(&camera()).get_pixel(16, 16);
        assert!(is_near(pixel.0, [64, 128, 255, 255]), "{posterize:?}: {pixel:?}");
    }
}

/// Sums of harmonics beyond the limits of half floats get the nearest colors of the palette.
#[test]
fn the_brightest_and_the_darkest_get_labels() {
    let (black, white) = ([0.0; 3], [1.0; 3]);
    let node = std::array::from_fn(|cell| Cell::leaf(cell as u32));
    for (value, expected) in [(f16::MAX, [255; 3]), (f16::MIN, [0; 3])] {
        // The constant and the three functions that are linear in the direction have one sign, seen from the camera.
        let coefficients = [value, value, -value, value].repeat(3 * 8);
        let field = activated(&field(Basis::Sh4, vec![node], vec![30.0; 8], coefficients), Activation::Identity);
        // The wrong color comes first.
        let colors = if value == f16::MAX { vec![black, white] } else { vec![white, black] };
        let mut stage = Stage::with_palette(&field, Palette::new(colors).unwrap());
        let prop = stage.prop;
        stage.headless.app.world_mut().entity_mut(prop).insert(Posterize { softness: 0.0, ..default() });
        let pixel = *stage.capture(&camera()).get_pixel(16, 16);
        assert_eq!(pixel.0[..3], expected, "{value}");
    }
}
