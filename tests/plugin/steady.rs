//! Tests labels that are kept from frame to frame while something moves.

use bevy::{prelude::*, render::camera::TemporalJitter};
use bevy_plenoctree::{
    BilateralFilter, BorderSmoothing, EdgeSmoothing, FieldPalette, Palette, PaletteMethod, PlenOctree, Posterize, Prop,
    PropQuality,
};
use glam::DVec3;
use image::RgbaImage;

use super::stage::{Stage, fields::colored, pixels::differing};

const SIZE: u32 = 96;
const TONES: [[f64; 3]; 2] = [[0.3, 0.3, 0.32], [0.7, 0.7, 0.68]];
const FRAMES: usize = 6;

/// Returns a ball of noise around the color that is as near to one tone as to the other.
fn noise() -> PlenOctree {
    let inside = |at: DVec3| if at.length() < 0.7 { 1e3 } else { 0.0 };
    let color = |at: DVec3| {
        let hash = (1e4 * (at.dot(DVec3::new(12.9898, 78.233, 37.719))).sin()).rem_euclid(1.0);
        DVec3::from(TONES[0]).lerp(TONES[1].into(), 0.5 + 0.3 * (hash - 0.5))
    };
    colored(6, inside, color)
}

fn view(steadiness: f32) -> Stage {
    let mut stage = Stage::new(SIZE);
    let filter = BilateralFilter { iterations: 0, ..default() };
    let (edges, borders) = (EdgeSmoothing::Off, BorderSmoothing::Off);
    stage.spawn_prop(&noise(), Posterize { filter, edges, borders, steadiness, ..Posterize::toon() });
    stage.paint(palette(TONES));
    stage.set_background(Color::srgb(0.2, 0.4, 0.9));
    turn(&mut stage, 0);
    stage.wait();
    stage
}

/// Turns the camera to a frame, by a part of a pixel each.
fn turn(view: &mut Stage, frame: usize) {
    let place = Quat::from_rotation_y(0.003 * frame as f32) * Vec3::new(0.3, 0.4, 2.4);
    view.set(Transform::from_translation(place).looking_at(Vec3::ZERO, Vec3::Y));
}

fn frames(view: &mut Stage) -> Vec<RgbaImage> {
    let frame = |frame| {
        turn(view, frame);
        view.capture()
    };
    (0..FRAMES).map(frame).collect()
}

fn palette(tones: [[f64; 3]; 2]) -> FieldPalette {
    let mut palette = Palette::new(tones.to_vec()).unwrap();
    palette.method = Some(PaletteMethod::Tones);
    FieldPalette::new(palette)
}

/// Returns how many labels change from frame to frame.
fn flicker(frames: &[RgbaImage]) -> usize {
    frames.windows(2).map(|two| differing(&two[0], &two[1], 0)).sum()
}

/// Fewer labels of noisy colors change, unless the setting or the quality is off. The others follow the ball.
#[test]
fn labels_flicker_less_while_the_camera_turns() {
    let loose = frames(&mut view(0.0));
    let mut view = view(Posterize::toon().steadiness);
    let steady = frames(&mut view);
    println!("{} labels change, {} if they are kept", flicker(&loose), flicker(&steady));
    assert!(flicker(&loose) > 300, "{}", flicker(&loose));
    assert!(10 * flicker(&steady) < 9 * flicker(&loose), "{} of {}", flicker(&steady), flicker(&loose));
    let steadiest = flicker(&frames(&mut self::view(f32::INFINITY)));
    assert!(4 * steadiest < 3 * flicker(&steady), "{steadiest} of {}", flicker(&steady));
    view.set(PropQuality::EXACT);
    assert!(frames(&mut view) == loose, "exact");
}

/// Labels are also kept where the prop moves instead, even if it rests between steps of physics, and a view at rest
/// shows what one frame shows.
#[test]
fn views_at_rest_forget() {
    let [mut loose, mut view] = [0.0, 0.1].map(view);
    let turned = |view: &mut Stage, frame| {
        view.dress(Transform::from_rotation(Quat::from_rotation_y(-0.003 * frame as f32)));
        view.capture()
    };
    let mut kept = 0;
    for frame in 1..FRAMES {
        let one = turned(&mut view, frame);
        kept += differing(&turned(&mut loose, frame), &one, 0);
        view.update(2);
        assert!(view.capture() == one, "between two steps");
    }
    assert!(kept > 500, "{kept}");
    // Another prop that goes on turns none of its labels into lasting ones.
    let field = view.field();
    let place = |angle| Transform::from_xyz(0.0, -30.0, 0.0).with_rotation(Quat::from_rotation_y(angle));
    let other = view.spawn((Prop(field), Posterize::toon(), place(0.0)));
    for frame in 1..12 {
        view.insert(other, place(0.01 * frame as f32));
        view.update(1);
    }
    assert!(differing(&loose.capture(), &view.capture(), 0) == 0, "at rest");
    let one = loose.capture();
    assert!(view.capture() == one && view.capture() == one);
}

/// Changes of the palette show at once, of shown colors and of source colors, while the camera turns.
#[test]
fn nothing_lags_behind_a_palette() {
    let [mut loose, mut view] = [0.0, 0.1].map(view);
    frames(&mut loose);
    frames(&mut view);
    let others = [[0.31, 0.3, 0.32], [0.55, 0.5, 0.5]];
    for view in [&mut loose, &mut view] {
        turn(view, FRAMES);
        view.paint(palette(others));
    }
    assert!(view.capture() == loose.capture(), "other labels");
    turn(&mut view, FRAMES + 1);
    view.palette().show([Color::srgb_u8(250, 0, 0), Color::srgb_u8(0, 250, 0)]);
    let shown = view.capture();
    let of = |color: [u8; 3]| shown.pixels().filter(|pixel| (0..3).all(|i| pixel.0[i].abs_diff(color[i]) <= 1)).count();
    let [red, green, sky] = [[250, 0, 0], [0, 250, 0], [51, 102, 230]].map(of);
    assert!(red + green > 1000, "{red}, {green}");
    let all = (SIZE * SIZE) as usize;
    assert!(all - red - green - sky < all / 100, "{} pixels show something else", all - red - green - sky);
}

/// A view with jitter, as for temporal antialiasing, forgets labels when it rests, too.
#[test]
fn jitter_keeps_no_labels() {
    let [mut loose, mut view] = [0.0, f32::INFINITY].map(view);
    let jittered = |view: &mut Stage, frame: usize| {
        let offset = Vec2::new(0.25 - 0.5 * (frame % 2) as f32, 0.1);
        view.set(TemporalJitter { offset });
        view.capture()
    };
    let mut kept = 0;
    for frame in 0..FRAMES {
        turn(&mut loose, frame);
        turn(&mut view, frame);
        kept += differing(&jittered(&mut loose, frame), &jittered(&mut view, frame), 0);
    }
    assert!(kept > 500, "{kept}");
    for frame in 0..14 {
        jittered(&mut view, frame);
    }
    assert!(jittered(&mut view, 0) == jittered(&mut loose, 0), "at rest");
}

/// Labels last where a prop is drawn at another level of detail.
#[test]
fn labels_last_across_levels() {
    let [mut loose, mut view] = [0.0, f32::INFINITY].map(view);
    let quality = |frame: usize| PropQuality { cell_size: [0.0, 5.0][frame % 2], ..default() };
    // Both levels are made.
    for view in [&mut loose, &mut view] {
        for frame in 0..2 {
            view.set(quality(frame));
            view.wait();
        }
    }
    let mut kept = 0;
    for frame in 0..FRAMES {
        let frames = [&mut loose, &mut view].map(|view| {
            turn(view, frame);
            view.set(quality(frame));
            view.capture()
        });
        kept += differing(&frames[0], &frames[1], 0);
    }
    assert!(kept > 500, "{kept}");
}
