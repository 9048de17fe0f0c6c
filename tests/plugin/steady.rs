//! Tests labels that are kept from frame to frame while something moves.

use std::time::Duration;

use bevy::prelude::*;
use bevy_plenoctree::{
    BilateralFilter, BorderSmoothing, EdgeSmoothing, FieldPalette, Palette, PaletteMethod, Palettes, PlenOctree,
    PlenOctreePlugin, Posterize, Prop, PropQuality, UpAxis,
    headless::{Headless, exact_camera},
};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{BakeSettings, Basis, bake};

const SIZE: u32 = 96;
const TONES: [[f64; 3]; 2] = [[0.3, 0.3, 0.32], [0.7, 0.7, 0.68]];
const FRAMES: usize = 6;

/// Returns a ball of noise around the color that is as near to one tone as to the other.
fn noise() -> PlenOctree {
    let settings = BakeSettings { depth: 6, basis: Basis::Rgba, up: UpAxis::Y, ..default() };
    let inside = |at: DVec3| if at.length() < 0.7 { 1e3 } else { 0.0 };
    let color = |at: DVec3| {
        let hash = (1e4 * (at.dot(DVec3::new(12.9898, 78.233, 37.719))).sin()).rem_euclid(1.0);
        DVec3::from(TONES[0]).lerp(TONES[1].into(), 0.5 + 0.3 * (hash - 0.5))
    };
    bake(&settings, inside, move |at| move |_| color(at)).unwrap()
}

struct View {
    headless: Headless,
    prop: Entity,
    camera: Entity,
    field: Handle<PlenOctree>,
}

impl View {
    fn new(steadiness: f32) -> Self {
        let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
            app.add_plugins(PlenOctreePlugin);
        })
        .unwrap();
        let target = headless.target();
        let world = headless.app.world_mut();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(noise());
        world.resource_mut::<Palettes>().insert(&field, palette(TONES));
        let filter = BilateralFilter { iterations: 0, ..default() };
        let (edges, borders) = (EdgeSmoothing::Off, BorderSmoothing::Off);
        let posterize = Posterize { filter, edges, borders, steadiness, ..Posterize::toon() };
        let prop = world.spawn((Prop(field.clone()), posterize)).id();
        let camera = world.spawn((exact_camera(Color::srgb(0.2, 0.4, 0.9)), target)).id();
        let mut view = Self { headless, prop, camera, field };
        view.turn(0);
        view.headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        view
    }

    /// Turns the camera to a frame, by a part of a pixel each.
    fn turn(&mut self, frame: usize) {
        let place = Quat::from_rotation_y(0.003 * frame as f32) * Vec3::new(0.3, 0.4, 2.4);
        let place = Transform::from_translation(place).looking_at(Vec3::ZERO, Vec3::Y);
        self.headless.app.world_mut().entity_mut(self.camera).insert(place);
    }

    fn capture(&mut self) -> RgbaImage {
        self.headless.capture().unwrap()
    }

    fn frames(&mut self) -> Vec<RgbaImage> {
        let frame = |frame| {
            self.turn(frame);
            self.capture()
        };
        (0..FRAMES).map(frame).collect()
    }
}

fn palette(tones: [[f64; 3]; 2]) -> FieldPalette {
    let mut palette = Palette::new(tones.to_vec()).unwrap();
    palette.method = Some(PaletteMethod::Tones);
    FieldPalette::new(palette)
}

fn differing(a: &RgbaImage, b: &RgbaImage) -> usize {
    a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count()
}

/// Returns how many labels change from frame to frame.
fn flicker(frames: &[RgbaImage]) -> usize {
    frames.windows(2).map(|two| differing(&two[0], &two[1])).sum()
}

/// Fewer labels of noisy colors change, unless the setting or the quality is off. The others follow the ball.
#[test]
fn labels_flicker_less_while_the_camera_turns() {
    let loose = View::new(0.0).frames();
    let mut view = View::new(Posterize::toon().steadiness);
    let steady = view.frames();
    println!("{} labels change, {} if they are kept", flicker(&loose), flicker(&steady));
    assert!(flicker(&loose) > 300, "{}", flicker(&loose));
    assert!(10 * flicker(&steady) < 8 * flicker(&loose), "{} of {}", flicker(&steady), flicker(&loose));
    view.headless.app.world_mut().entity_mut(view.camera).insert(PropQuality::EXACT);
    assert!(view.frames() == loose, "exact");
}

/// Labels are also kept where the prop moves instead, and a view at rest shows what one frame shows.
#[test]
fn views_at_rest_forget() {
    let mut loose = View::new(0.0);
    let mut view = View::new(0.1);
    let turned = |view: &mut View, frame| {
        let place = Transform::from_rotation(Quat::from_rotation_y(-0.003 * frame as f32));
        view.headless.app.world_mut().entity_mut(view.prop).insert(place);
        view.capture()
    };
    let kept = (0..FRAMES).map(|frame| differing(&turned(&mut loose, frame), &turned(&mut view, frame))).sum::<usize>();
    assert!(kept > 500, "{kept}");
    assert!(differing(&loose.capture(), &view.capture()) == 0, "at rest");
    let one = loose.capture();
    assert!(view.capture() == one && view.capture() == one);
}

/// Changes of the palette show at once, of shown colors and of source colors, while the camera turns.
#[test]
fn nothing_lags_behind_a_palette() {
    let mut loose = View::new(0.0);
    let mut view = View::new(0.1);
    loose.frames();
    view.frames();
    let others = [[0.31, 0.3, 0.32], [0.55, 0.5, 0.5]];
    for view in [&mut loose, &mut view] {
        view.turn(FRAMES);
        let palettes = view.headless.app.world_mut().resource_mut::<Palettes>();
        palettes.into_inner().insert(&view.field, palette(others));
    }
    assert!(view.capture() == loose.capture(), "other labels");
    view.turn(FRAMES + 1);
    let mut palettes = view.headless.app.world_mut().resource_mut::<Palettes>();
    palettes.get_mut(&view.field).unwrap().show([Color::srgb_u8(250, 0, 0), Color::srgb_u8(0, 250, 0)]);
    let shown = view.capture();
    let of = |color: [u8; 3]| shown.pixels().filter(|pixel| (0..3).all(|i| pixel.0[i].abs_diff(color[i]) <= 1)).count();
    let [red, green, sky] = [[250, 0, 0], [0, 250, 0], [51, 102, 230]].map(of);
    assert!(red + green > 1000, "{red}, {green}");
    let all = (SIZE * SIZE) as usize;
    assert!(all - red - green - sky < all / 100, "{} pixels show something else", all - red - green - sky);
}
