//! Tests smooth borders and ink.

use bevy::prelude::*;
use bevy_plenoctree::{
    BilateralFilter, BorderSmoothing, EdgeSmoothing, FieldPalette, Ink, InkBorders, InkColor, Palette, PaletteMethod,
    Posterize, Ramp, SolidOpacity,
};
use glam::DVec3;
use half::f16;
use image::RgbaImage;
use plenoctree::Basis;

use super::stage::{
    Stage,
    fields::{Shell, colored, field, shape},
    pixels::{at, color, differing, is_near, linear, places},
};

const SIZE: u32 = 96;
/// The rays per pixel of the picture to compare with, along each axis.
const FINE: u32 = 4;
const COLORS: [[f64; 3]; 2] = [[0.9, 0.2, 0.2], [0.95, 0.9, 0.85]];
const SKY: Color = Color::srgb(0.3, 0.5, 0.9);

/// A ball whose color changes across a tilted plane, in two tones. Its cells are smaller than pixels.
struct Look(Stage);

fn of_tones(tones: &[[f64; 3]]) -> Palette {
    let mut palette = Palette::new(tones.to_vec()).unwrap();
    palette.method = Some(PaletteMethod::Tones);
    palette
}

impl Look {
    /// A shell of cells of this depth, with the colors of tones.
    fn of<const N: usize>(tones: [[f64; 3]; N], depth: u32, thinnest: f64, color: impl Fn(DVec3) -> DVec3) -> Self {
        let mut stage = Stage::new(SIZE);
        // Baking would visit all cells of the box.
        let [inner, outer] = [thinnest, 0.7].map(|radius| radius * f64::from(1u32 << (depth - 1)));
        let Shell { nodes, leaves } = Shell::new(depth, 0.5 * (inner + outer), outer - inner);
        let colors = leaves.iter().flat_map(|at| color(*at).to_array().map(f16::from_f64)).collect();
        stage.spawn_prop(&field(Basis::Rgba, nodes, vec![1e4; leaves.len()], colors), ());
        stage.paint(FieldPalette::new(of_tones(&tones)));
        stage.set_background(SKY);
        stage.set(Transform::from_xyz(0.3, 0.5, 2.4).looking_at(Vec3::ZERO, Vec3::Y));
        Self(stage)
    }

    fn new() -> Self {
        let slope = DVec3::new(0.4, 0.9, 0.2);
        let color = move |at: DVec3| {
            let share = (6.0 * at.dot(slope) + 0.5).clamp(0.0, 1.0);
            DVec3::from(COLORS[0]).lerp(COLORS[1].into(), share)
        };
        Self::of(COLORS, 8, 0.68, color)
    }

    fn capture(&mut self, size: u32, posterize: Posterize, ink: Option<Ink>) -> RgbaImage {
        self.0.headless.resize(UVec2::splat(size));
        self.0.undress::<Ink>();
        self.0.dress(posterize);
        if let Some(ink) = ink {
            self.0.dress(ink);
        }
        self.0.wait();
        self.0.capture()
    }
}

/// Returns the mean of each square of pixels, in linear light.
fn reduced(fine: &RgbaImage) -> Vec<Vec3> {
    let mean = |x: u32, y: u32| {
        let inside = (0..FINE * FINE).map(|i| linear(fine.get_pixel(FINE * x + i % FINE, FINE * y + i / FINE)));
        inside.sum::<Vec3>() / (FINE * FINE) as f32
    };
    places(SIZE, SIZE).map(|(x, y)| mean(x, y)).collect()
}

fn is_sky(pixel: &image::Rgba<u8>) -> bool {
    is_near([pixel[0], pixel[1], pixel[2]], SKY, 1)
}

/// Borders between labels come nearer to those of sixteen labels per pixel, and pixels away from borders stay as they
/// are. Where cells are not much smaller than pixels, their own borders are stairs.
#[test]
fn smooth_borders_show_what_finer_pixels_show() {
    let mut look = Look::new();
    for (distance, pixels, most) in [(1.0, 0.4, 0.45), (2.0, 0.2, 1.0 / 3.0)] {
        let place = distance * Vec3::new(0.3, 0.5, 2.4);
        look.0.set(Transform::from_translation(place).looking_at(Vec3::ZERO, Vec3::Y));
        let ([before, after], smoothed) = border_errors(&mut look);
        // Farther away, borders are shorter.
        let least = (SIZE as f32 / (2.0 * distance)) as u32;
        assert!((least..8 * SIZE).contains(&smoothed), "{smoothed}");
        println!("cells of {pixels} pixels: {:.2} of the error of stairs", after / before);
        assert!(after < most * before, "{after} of {before}");
    }
}

/// Returns the errors of hard and of smooth borders, and the number of pixels that differ.
fn border_errors(look: &mut Look) -> ([f32; 2], u32) {
    let hard = Posterize { borders: BorderSmoothing::Off, ..Posterize::toon() };
    // The filter reaches as far within the ball.
    let unfiltered = |posterize: Posterize| {
        let mut posterize = posterize;
        posterize.filter.iterations = 0;
        posterize
    };
    let wanted = reduced(&look.capture(FINE * SIZE, unfiltered(hard), None));
    let stairs = look.capture(SIZE, unfiltered(hard), None);
    let smooth = look.capture(SIZE, unfiltered(Posterize::toon()), None);
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
    (errors.map(f32::sqrt), smoothed)
}

/// Details of a few pixels keep their color, although islands of similar colors go to their surroundings.
#[test]
fn small_details_stay() {
    const TONES: [[f64; 3]; 2] = [[0.2, 0.3, 0.7], [0.9, 0.85, 0.3]];
    let dotted = |at: DVec3| {
        let is_dot = (20.0 * at).to_array().iter().all(|x| x.rem_euclid(2.0) < 0.8);
        DVec3::from(TONES[usize::from(is_dot)])
    };
    let mut look = Look::of(TONES, 7, 0.66, dotted);
    let mut capture = |borders| {
        let filter = BilateralFilter { iterations: 0, ..default() };
        look.capture(SIZE, Posterize { borders, filter, edges: EdgeSmoothing::Off, ..Posterize::toon() }, None)
    };
    let [hard, smooth] = [BorderSmoothing::Off, BorderSmoothing::Interpolated].map(&mut capture);
    // More red than blue, and less.
    let is_dot = |frame: &RgbaImage, x, y| frame.get_pixel(x, y)[0] > frame.get_pixel(x, y)[2];
    let (mut dots, mut kept) = (0, 0);
    for (x, y) in places(SIZE, SIZE).filter(|(x, y)| is_dot(&hard, *x, *y)) {
        dots += 1;
        kept += u32::from(is_dot(&smooth, x, y));
    }
    assert!(dots > 100, "{dots}");
    assert!(10 * kept >= 9 * dots, "{kept} of {dots} pixels of dots");
}

/// Where the colors of two materials meet, those in between do not draw a line in the color of a third, unless it is as
/// wide as a detail.
#[test]
fn no_third_label_lines_a_border() {
    const TONES: [[f64; 3]; 3] = [[0.9, 0.2, 0.2], [0.55, 0.45, 0.4], [0.2, 0.7, 0.6]];
    // The width of what is between, in pixels.
    let share_of_seam = |width: f64| {
        let slope = DVec3::new(0.2, 0.5, 0.0).normalize();
        let color = move |at: DVec3| {
            let side = 0.0098 * width - (at.dot(slope) - 0.05).abs();
            let index = if side > 0.0 { 1 } else { 2 * usize::from(at.dot(slope) > 0.05) };
            DVec3::from(TONES[index])
        };
        let mut look = Look::of(TONES, 8, 0.68, color);
        let mut palette = of_tones(&TONES);
        palette.ramps = (0..3).map(|tone| Ramp { name: format!("material {tone}"), tones: vec![tone] }).collect();
        look.0.paint(FieldPalette::new(palette));
        let mut capture = |borders| {
            let filter = BilateralFilter { iterations: 0, ..default() };
            look.capture(SIZE, Posterize { borders, filter, edges: EdgeSmoothing::Off, ..Posterize::toon() }, None)
        };
        let middle = Color::srgb_from_array(TONES[1].map(|channel| channel as f32));
        let count = |frame: RgbaImage| {
            frame.pixels().filter(|pixel| is_near([pixel[0], pixel[1], pixel[2]], middle, 8)).count()
        };
        let [hard, smooth] = [BorderSmoothing::Off, BorderSmoothing::Interpolated].map(&mut capture).map(count);
        println!("{width} pixels wide: {hard} pixels of the third label, {smooth} with smooth borders");
        assert!(hard > 20, "{hard}");
        smooth as f64 / hard as f64
    };
    assert!(share_of_seam(0.6) < 0.05);
    assert!(share_of_seam(4.0) > 0.6);
}

/// The labels of glass, and of what is in it, do not depend on what is behind them, also at edges. They let it through
/// as the field does.
#[test]
fn labels_do_not_depend_on_what_is_behind() {
    let mut stage = Stage::new(SIZE);
    let density = |at: DVec3| match at.length() {
        ..0.3 => 1e4,
        ..0.7 => 0.4,
        _ => 0.0,
    };
    let color = |at: DVec3| DVec3::from(COLORS[usize::from(at.length() >= 0.3)]);
    stage.spawn_prop(&colored(7, density, color), ());
    stage.paint(FieldPalette::new(of_tones(&[&COLORS[..], &[[0.3, 0.5, 0.9], [0.1; 3]]].concat())));
    stage.set(Transform::from_xyz(0.0, 0.0, 2.4).looking_at(Vec3::ZERO, Vec3::Y));
    let mut look = Look(stage);
    let mut capture = |background| {
        look.0.set_background(background);
        look.capture(SIZE, Posterize::toon(), None)
    };
    let [over_black, over_red] = [Color::BLACK, Color::srgb(1.0, 0.0, 0.0)].map(&mut capture);
    let (mut opaque, mut glass) = (0, 0);
    for (x, y) in places(SIZE, SIZE) {
        let place = [x, y].map(|at| at as f32 + 0.5 - SIZE as f32 / 2.0);
        // Where enough of the glass is in front of what is behind.
        if place[0].hypot(place[1]) < 23.0 {
            let [before, after] = [&over_black, &over_red].map(|frame| frame.get_pixel(x, y).0);
            // What is red lets red through, and nothing else changes.
            assert!((1..3).all(|i| before[i].abs_diff(after[i]) <= 1), "{x}, {y}: {before:?}, {after:?}");
            match after[0] - before[0] {
                0..=1 => opaque += 1,
                100..=180 => glass += 1,
                _ => {}
            }
        }
    }
    assert!(opaque > 500 && glass > 500, "{opaque} opaque pixels, {glass} of glass");
}

/// Also not where the background has nearly the color of the prop.
#[test]
fn backgrounds_of_similar_colors_change_no_label() {
    let mut stage = Stage::new(SIZE);
    let gray = |encoded: f64| [encoded; 3];
    stage.spawn_prop(&shape(1e4, DVec3::splat(0.505), |at| at.abs().max_element() < 0.5), ());
    stage.paint(FieldPalette::new(of_tones(&[gray(0.45), gray(0.55)])));
    stage.palette().show([Color::srgb(0.0, 1.0, 0.0), Color::srgb(1.0, 0.0, 0.0)]);
    stage.set(Transform::from_xyz(0.0, 0.0, 2.4).looking_at(Vec3::ZERO, Vec3::Y));
    let mut look = Look(stage);
    let hard = Posterize { edges: EdgeSmoothing::Off, borders: BorderSmoothing::Off, ..Posterize::toon() };
    let mut red = |background: f32| {
        look.0.set_background(Color::srgb(background, background, background));
        let frame = look.capture(SIZE, hard, None);
        places(SIZE, SIZE).filter(|(x, y)| at(&frame, *x, *y) == [255, 0, 0]).count()
    };
    let count = red(1.0);
    assert!(count > 500);
    for background in [0.43, 0.45, 0.47] {
        assert_eq!(red(background), count, "over {background}");
    }
}

/// Of tones at the same distance, the first one counts, whether a color is darker or lighter.
#[test]
fn the_first_of_equal_tones_counts() {
    let mut look = Look::new();
    let middle = [0.9, 0.55, 0.5];
    look.0.paint(FieldPalette::new(of_tones(&[middle, middle])));
    look.0.palette().show([Color::srgb(0.0, 1.0, 0.0), Color::srgb(1.0, 0.0, 0.0)]);
    let hard = Posterize { edges: EdgeSmoothing::Off, borders: BorderSmoothing::Off, ..Posterize::toon() };
    let frame = look.capture(SIZE, hard, None);
    let shown = |color| places(SIZE, SIZE).filter(|(x, y)| at(&frame, *x, *y) == color).count();
    assert!(shown([0, 255, 0]) > 1000);
    assert_eq!(shown([255, 0, 0]), 0);
}

/// A camera's ink is for props without their own, even if theirs draws nothing.
#[test]
fn props_keep_the_ink_of_a_camera_away() {
    let mut look = Look::new();
    let plain = look.capture(SIZE, Posterize::toon(), None);
    look.0.set(Ink { width: 1.0, max_pixels: 3.0, ..default() });
    assert_ne!(look.capture(SIZE, Posterize::toon(), None), plain, "the camera's ink");
    for nothing in [
        Ink { width: 0.0, ..default() },
        Ink { color: InkColor::Flat(Color::NONE), ..default() },
        Ink { silhouette: false, creases: false, borders: InkBorders::None, ..default() },
    ] {
        assert_eq!(look.capture(SIZE, Posterize::toon(), Some(nothing.clone())), plain, "{nothing:?}");
    }
}

/// Lines are as wide as they may be, on the prop's side of its silhouette, and nothing else changes.
#[test]
fn ink_lies_within_the_silhouette() {
    let mut look = Look::new();
    let plain = look.capture(SIZE, Posterize::toon(), None);
    for max_pixels in [1.0, 3.0] {
        let ink = Ink { width: 1.0, max_pixels, creases: false, borders: InkBorders::None, ..default() };
        let inked = look.capture(SIZE, Posterize::toon(), Some(ink));
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

/// Where nothing is solid, lines are as wide as at the distance of the prop's box, whatever is behind it.
#[test]
fn ink_lies_on_haze_and_glass() {
    let mut look = Look::new();
    let plain = look.capture(SIZE, Posterize::toon(), None);
    let ink = Ink { width: 0.1, max_pixels: 3.0, creases: false, borders: InkBorders::None, ..default() };
    let solid = look.capture(SIZE, Posterize::toon(), Some(ink.clone()));
    look.0.dress(SolidOpacity::Never);
    let haze = look.capture(SIZE, Posterize::toon(), Some(ink));
    assert!(differing(&plain, &solid, 40) > SIZE as usize);
    let differing = differing(&solid, &haze, 40);
    assert!(differing < SIZE as usize / 4, "{differing} pixels");
}

/// Lines between ramps follow the border, and ramps that are not listed have none. A tone is darker than its label.
#[test]
fn ink_divides_ramps() {
    let mut look = Look::new();
    let plain = look.capture(SIZE, Posterize::toon(), None);
    let mut with = |color, borders| {
        let ink = Ink { color, width: 0.05, silhouette: false, creases: false, borders, ..default() };
        look.capture(SIZE, Posterize::toon(), Some(ink))
    };
    let black = InkColor::default();
    let count = |inked: &RgbaImage| differing(&plain, inked, 0);
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

/// The deeper a step, the darker its line, from none to a whole one: where noise decides, there are no dots.
#[test]
fn ink_fades_in_at_creases() {
    const STEP: f64 = 0.25;
    let mut stage = Stage::new(SIZE);
    let stairs =
        |at: DVec3| at.truncate().abs().max_element() < 0.75 && at.z < if at.x < 0.0 { 0.5 } else { 0.5 - STEP };
    stage.spawn_prop(&shape(1e4, COLORS[1].into(), stairs), Posterize::toon());
    stage.paint(FieldPalette::new(Palette::new(COLORS.to_vec()).unwrap()));
    stage.set_background(SKY);
    stage.set(Transform::from_xyz(0.0, 0.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y));
    let [none, faint, whole] = [7.0, 10.0, 13.0].map(|widths| {
        let (width, borders) = (STEP as f32 / widths, InkBorders::None);
        stage.dress(Ink { width, max_pixels: 1.0, silhouette: false, borders, ..default() });
        let frame = stage.capture();
        // How much of the pixels of a row is black, within the prop.
        let inside = SIZE / 2 - 8..SIZE / 2 + 8;
        inside
            .map(|x| 1.0 - linear(frame.get_pixel(x, SIZE / 2)).x / linear(frame.get_pixel(SIZE / 2 - 8, SIZE / 2)).x)
            .sum::<f32>()
    });
    assert!(none == 0.0 && (0.1..0.9 * whole).contains(&faint) && whole > 0.7, "{none}, {faint}, {whole}");
}

/// Where the front of glass is just solid, its depth jumps to that of the back. This is no crease.
#[test]
fn glass_has_no_creases() {
    let mut stage = Stage::new(SIZE);
    let density = |at: DVec3| match at.length() {
        0.66..0.7 => 3.0,
        _ => 0.0,
    };
    stage.spawn_prop(&colored(7, density, |_| COLORS[1].into()), ());
    stage.paint(FieldPalette::new(of_tones(&COLORS)));
    stage.set_background(SKY);
    stage.set(Transform::from_xyz(0.0, 0.0, 2.4).looking_at(Vec3::ZERO, Vec3::Y));
    let mut look = Look(stage);
    let ink = Ink { width: 0.02, silhouette: false, borders: InkBorders::None, ..default() };
    let [none, creases] = [None, Some(ink)].map(|ink| look.capture(SIZE, Posterize::toon(), ink));
    assert!(none.pixels().filter(|pixel| !is_sky(pixel)).count() > 1000);
    assert_eq!(differing(&none, &creases, 0), 0);
}

/// Between two ramps, pixels of a third one that are no wider than the line are no holes in it.
#[test]
fn ink_covers_seams() {
    let mut look = Look::new();
    let ink = Ink { width: 1.0, max_pixels: 6.0, silhouette: false, creases: false, ..default() };
    let lines = look.capture(SIZE, Posterize::toon(), Some(ink.clone()));
    let mixed = DVec3::from(COLORS[0]).lerp(COLORS[1].into(), 0.5);
    let mut palette = Palette::new(vec![COLORS[0], mixed.to_array(), COLORS[1]]).unwrap();
    palette.method = Some(PaletteMethod::Tones);
    look.0.paint(FieldPalette::new(palette));
    let plain = look.capture(SIZE, Posterize::toon(), None);
    let seams = look.capture(SIZE, Posterize::toon(), Some(ink));
    let seam: Vec<_> = places(SIZE, SIZE).filter(|(x, y)| is_near(at(&plain, *x, *y), color(mixed), 2)).collect();
    assert!(seam.len() > 20, "{} pixels", seam.len());
    let holes = |frame: &RgbaImage| seam.iter().filter(|(x, y)| linear(frame.get_pixel(*x, *y)).x > 0.05).count();
    let (with, without) = (holes(&seams), holes(&lines));
    assert!(with <= without, "{with} of the seam's {} pixels are not black, and {without} without it", seam.len());
}
