//! Tests smooth borders and ink.

use std::{sync::LazyLock, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    BorderSmoothing, FieldPalette, Ink, InkBorders, InkColor, Palette, PaletteMethod, Palettes, PlenOctree,
    PlenOctreePlugin, Posterize, Prop, UpAxis,
    headless::{Headless, exact_camera},
};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{BakeSettings, Basis, bake};

const SIZE: u32 = 96;
/// The rays per pixel of the picture to compare with, along each axis.
const FINE: u32 = 4;
const COLORS: [[f64; 3]; 2] = [[0.9, 0.2, 0.2], [0.95, 0.9, 0.85]];
const SKY: Color = Color::srgb(0.3, 0.5, 0.9);

/// A ball whose color changes across a tilted plane. Its cells are smaller than pixels.
static BALL: LazyLock<PlenOctree> = LazyLock::new(|| {
    let settings = BakeSettings { depth: 8, basis: Basis::Rgba, up: UpAxis::Y, ..default() };
    let slope = DVec3::new(0.4, 0.9, 0.2);
    let color = move |at: DVec3| {
        let share = (6.0 * at.dot(slope) + 0.5).clamp(0.0, 1.0);
        DVec3::from(COLORS[0]).lerp(COLORS[1].into(), share)
    };
    let inside = |at: DVec3| if (0.68..0.7).contains(&at.length()) { 1e4 } else { 0.0 };
    bake(&settings, inside, move |at| move |_| color(at)).unwrap()
});

/// Draws it in two tones.
fn capture(size: u32, posterize: Posterize, ink: Option<Ink>) -> RgbaImage {
    let mut palette = Palette::new(COLORS.to_vec()).unwrap();
    palette.method = Some(PaletteMethod::Tones);

    let mut headless = Headless::new(UVec2::splat(size), |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(BALL.clone());
    world.resource_mut::<Palettes>().insert(&field, FieldPalette::new(palette));
    let prop = world.spawn((Prop(field), posterize)).id();
    if let Some(ink) = ink {
        world.entity_mut(prop).insert(ink);
    }
    world.spawn((exact_camera(SKY), target, Transform::from_xyz(0.3, 0.5, 2.4).looking_at(Vec3::ZERO, Vec3::Y)));
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    headless.capture().unwrap()
}

fn linear(pixel: &image::Rgba<u8>) -> Vec3 {
    let [red, green, blue, _] = pixel.0;
    LinearRgba::from(Srgba::rgb_u8(red, green, blue)).to_vec3()
}

/// Returns the mean of each square of pixels, in linear light.
fn reduced(fine: &RgbaImage) -> Vec<Vec3> {
    let mean = |x: u32, y: u32| {
        let inside = (0..FINE * FINE).map(|i| linear(fine.get_pixel(FINE * x + i % FINE, FINE * y + i / FINE)));
        inside.sum::<Vec3>() / (FINE * FINE) as f32
    };
    (0..SIZE * SIZE).map(|i| mean(i % SIZE, i / SIZE)).collect()
}

fn is_sky(pixel: &image::Rgba<u8>) -> bool {
    let sky = SKY.to_srgba().to_u8_array_no_alpha();
    (0..3).all(|channel| pixel.0[channel].abs_diff(sky[channel]) <= 1)
}

/// Borders between labels come nearer to those of sixteen labels per pixel, and pixels away from borders stay as they are.
#[test]
fn smooth_borders_show_what_finer_pixels_show() {
    let hard = Posterize { borders: BorderSmoothing::Off, ..Posterize::toon() };
    // The filter reaches as far within the ball.
    let unfiltered = |posterize: Posterize| {
        let mut posterize = posterize;
        posterize.filter.iterations = 0;
        posterize
    };
    let wanted = reduced(&capture(FINE * SIZE, unfiltered(hard), None));
    let (stairs, smooth) = (capture(SIZE, unfiltered(hard), None), capture(SIZE, unfiltered(Posterize::toon()), None));
    let labels = COLORS.map(|color| color.map(|channel| (255.0 * channel).round() as u8));
    let is_label =
        |pixel: &image::Rgba<u8>| labels.iter().any(|label| (0..3).all(|i| pixel.0[i].abs_diff(label[i]) <= 1));
    let (mut errors, mut smoothed) = ([0.0; 2], 0);
    for (index, (before, after)) in stairs.pixels().zip(smooth.pixels()).enumerate() {
        // Pixels at the silhouette are mixed with the sky either way.
        if before == after || !is_label(before) {
            continue;
        }
        let (x, y) = (index as u32 % SIZE, index as u32 / SIZE);
        let mut around = (0..9).map(|i| stairs.get_pixel(x + i % 3 - 1, y + i / 3 - 1));
        assert!(around.any(|there| there != before), "{x}, {y} is away from borders");
        smoothed += 1;
        errors[0] += wanted[index].distance_squared(linear(before));
        errors[1] += wanted[index].distance_squared(linear(after));
    }
    assert!((SIZE / 2..8 * SIZE).contains(&smoothed), "{smoothed}");
    let [before, after] = errors.map(f32::sqrt);
    println!("error at borders: {before} with stairs, {after} if smooth: {:.2} of it", after / before);
    assert!(after < 0.45 * before, "{after} of {before}");
}

/// Lines are as wide as they may be, on the prop's side of its silhouette, and nothing else changes.
#[test]
fn ink_lies_within_the_silhouette() {
    let plain = capture(SIZE, Posterize::toon(), None);
    for max_pixels in [1.0, 3.0] {
        let ink = Ink { width: 1.0, max_pixels, creases: false, borders: InkBorders::None, ..default() };
        let inked = capture(SIZE, Posterize::toon(), Some(ink));
        // The part of a pixel that is black.
        let line = |x: u32, y: u32| 1.0 - linear(inked.get_pixel(x, y)).x / linear(plain.get_pixel(x, y)).x;
        let mut lines = 0;
        for y in 1..SIZE - 1 {
            let row: Vec<_> = (0..SIZE).filter(|x| !is_sky(plain.get_pixel(*x, y))).collect();
            assert!((0..SIZE).all(|x| plain.get_pixel(x, y) == inked.get_pixel(x, y) || row.contains(&x)), "{y}");
            let (Some(first), Some(last)) = (row.first(), row.last()) else {
                continue;
            };
            // In the middle, the silhouette is steep.
            if y.abs_diff(SIZE / 2) < SIZE / 8 {
                let width: f32 = (*first..SIZE / 2).map(|x| line(x, y)).sum();
                assert!((width - max_pixels).abs() <= 1.25, "{width} of {max_pixels} pixels in row {y}");
                let reach = max_pixels as u32 + 3;
                let inner = first + reach..last.saturating_sub(reach);
                assert!(inner.into_iter().all(|x| plain.get_pixel(x, y) == inked.get_pixel(x, y)), "{y}");
                lines += 1;
            }
        }
        assert!(lines > 10);
    }
}

/// Lines between ramps follow the border, and ramps that are not listed have none. A tone is darker than its label.
#[test]
fn ink_divides_ramps() {
    let plain = capture(SIZE, Posterize::toon(), None);
    let with = |color, borders| {
        let ink = Ink { color, width: 0.05, silhouette: false, creases: false, borders, ..default() };
        capture(SIZE, Posterize::toon(), Some(ink))
    };
    let black = InkColor::default();
    let count = |inked: &RgbaImage| plain.pixels().zip(inked.pixels()).filter(|(a, b)| a != b).count();
    let lines = with(black, InkBorders::Ramps);
    assert!(count(&lines) > SIZE as usize / 2, "{}", count(&lines));
    assert_eq!(with(black, InkBorders::Labels), lines);
    // Colors without ramps are ramps by themselves, which no pair names.
    assert_eq!(count(&with(black, InkBorders::Pairs(vec![[0, 1]]))), 0);
    let toned = with(InkColor::Tone(0.5), InkBorders::Ramps);
    // The faintest parts of a tone may round to the label's own color.
    assert!(count(&toned).abs_diff(count(&lines)) <= 3);
    assert!(toned.pixels().zip(plain.pixels()).all(|(tone, plain)| tone.0.iter().zip(plain.0).all(|(a, b)| *a <= b)));
}
