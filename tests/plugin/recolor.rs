//! Tests recoloring without labels.

use bevy::prelude::*;
use bevy_plenoctree::{
    FieldPalette, Palette, PaletteMethod, PaletteOverride, PlenOctree, Posterize, PropTint, Recolor,
};
use glam::DVec3;
use image::RgbaImage;

use super::stage::{Stage, fields::colored};

const SIZE: u32 = 96;
const RED: [f64; 3] = [0.8, 0.15, 0.15];
const WHITE: [f64; 3] = [0.9, 0.88, 0.85];
const SKY: Color = Color::srgb(0.3, 0.35, 0.32);

/// Returns a ball whose color passes from red to white, in a haze of red.
fn ball() -> PlenOctree {
    let density = |at: DVec3| match at.length() {
        ..0.6 => 1e3,
        ..0.9 => 0.5,
        _ => 0.0,
    };
    let color = |at: DVec3| {
        let share = if at.length() < 0.65 { (4.0 * at.y + 0.5).clamp(0.0, 1.0) } else { 0.0 };
        DVec3::from(RED).lerp(WHITE.into(), share)
    };
    colored(6, density, color)
}

fn palette() -> Palette {
    let mut palette = Palette::new(vec![RED, [0.55, 0.1, 0.1], WHITE]).unwrap();
    palette.method = Some(PaletteMethod::Tones);
    palette.gather_tones(&[0, 1], "red").unwrap();
    palette
}

fn view(look: impl Bundle, sky: Color) -> Stage {
    let mut stage = Stage::new(SIZE);
    stage.spawn_prop(&ball(), look);
    stage.paint(FieldPalette::new(palette()));
    stage.set_background(sky);
    stage.set(Transform::from_xyz(0.3, 0.5, 2.6).looking_at(Vec3::ZERO, Vec3::Y));
    stage.wait();
    stage
}

/// Captures the prop with these components.
fn with(view: &mut Stage, components: impl Bundle) -> RgbaImage {
    view.dress(components);
    view.capture()
}

fn blue() -> PaletteOverride {
    PaletteOverride::default().with_ramp("red", Color::srgb(0.15, 0.25, 0.8))
}

/// Every pixel is what the reference makes of its color as trained, nothing changes where nothing was recolored, and
/// one entity's colors are its own.
#[test]
fn props_as_trained_are_recolored_as_the_reference_is() {
    let mut view = view((), Color::NONE);
    let trained = view.capture();
    assert!(with(&mut view, Recolor::default()) == trained, "nothing is changed");
    assert!(with(&mut view, blue()) != trained);
    let recolored = view.capture();
    view.undress::<Recolor>();
    assert!(view.capture() == trained, "without the component");
    let shown: Vec<_> = {
        let own = blue().shown(&view.palette());
        own.iter().map(|color| color.to_srgba().to_f32_array_no_alpha().map(f64::from)).collect()
    };
    let (mut compared, mut kept, mut worst) = (0, 0, 0.0f64);
    for (before, after) in trained.pixels().zip(recolored.pixels()) {
        let share = |channel: u8| f64::from(channel) / 255.0;
        let [red, green, blue, alpha] = before.0.map(share);
        if alpha < 1.0 {
            continue;
        }
        // The pixel was rounded. Between tones that are far apart, that matters.
        let exact = |corner: usize| {
            let rounded = |channel: f64, bit: usize| channel + if corner >> bit & 1 == 0 { 0.5 } else { -0.5 } / 255.0;
            let color = palette().recolored_as_trained([rounded(red, 0), rounded(green, 1), rounded(blue, 2)], &shown);
            DVec3::from(color).clamp(DVec3::ZERO, DVec3::ONE)
        };
        let low = (1..8).fold(exact(0), |low, corner| low.min(exact(corner)));
        let high = (1..8).fold(exact(0), |high, corner| high.max(exact(corner)));
        let found = DVec3::new(share(after[0]), share(after[1]), share(after[2]));
        let off = (low - found).max(found - high).max_element();
        worst = worst.max(off);
        compared += 1;
        kept += usize::from(before == after);
    }
    println!("{compared} pixels, {kept} as before, off by at most {:.2} of 255", 255.0 * worst);
    assert!(compared > 1000 && kept > 100 && compared - kept > 500, "{compared}, {kept}");
    assert!(worst < 2.5 / 255.0, "{worst}");
}

fn is_reddish(pixel: &image::Rgba<u8>) -> bool {
    let [red, green, blue, _] = pixel.0.map(i32::from);
    red > green.max(blue) + 12
}

/// The haze around a posterized prop has the colors of its palette, too: none of the old color is left around it. In
/// the look of the paper, haze is as rendered.
#[test]
fn haze_is_recolored_with_the_prop() {
    for look in [Posterize::toon(), Posterize::soft()] {
        let mut view = view(look, SKY);
        let plain = view.capture();
        let before = plain.pixels().filter(|pixel| is_reddish(pixel)).count();
        assert!(before > 2000, "{before}");
        let same = PaletteOverride::default().with(0, Color::srgb(0.8, 0.15, 0.15));
        assert!(with(&mut view, same) == plain, "the same color");
        let recolored = with(&mut view, blue());
        let after = recolored.pixels().filter(|pixel| is_reddish(pixel)).count();
        assert_eq!(after, 0, "{look:?}: reddish pixels, {before} before");
        let dim = with(&mut view, PropTint(Color::linear_rgb(0.5, 0.5, 0.5)));
        let after = dim.pixels().filter(|pixel| is_reddish(pixel)).count();
        assert_eq!(after, 0, "{look:?}, dimmed: reddish pixels");
    }
}
