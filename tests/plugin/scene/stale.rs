//! Tests that a frame shows nothing of the frames before it.

use std::time::Duration;

use bevy::{camera::Hdr, prelude::*};
use bevy_plenoctree::{
    BeforePalette, BilateralFilter, BorderSmoothing, EdgeSmoothing, FieldPalette, Palettes, PlenOctree,
    PlenOctreePlugin, Posterize, Prop, PropQuality, SolidOpacity,
    headless::{Headless, exact_camera},
};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{BakeSettings, Basis, bake};

use crate::idle_stage::idle_stage;

const SIZE: u32 = 128;

/// Bakes a cube from -1/2 to 1/2 whose color differs from place to place.
fn field(density: f64) -> PlenOctree {
    let settings = BakeSettings { depth: 4, basis: Basis::Rgba, min_density: 0.0, ..default() };
    let inside = move |at: DVec3| if at.abs().max_element() < 0.5 { density } else { 0.0 };
    bake(&settings, inside, |at| move |_| 0.5 + 0.5 * (9.0 * at).map(f64::sin)).unwrap()
}

struct View {
    headless: Headless,
    camera: Entity,
    field: Handle<PlenOctree>,
}

impl View {
    fn new() -> Self {
        let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
            app.add_plugins(PlenOctreePlugin);
        })
        .unwrap();
        let target = headless.target();
        let world = headless.app.world_mut();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(field(30.0));
        let colors = [Color::srgb(0.8, 0.2, 0.1), Color::srgb(0.1, 0.3, 0.8), Color::srgb(0.9, 0.9, 0.2)];
        let palette = FieldPalette::from_colors(colors).unwrap();
        world.resource_mut::<Palettes>().insert(&field, palette);
        let place = Transform::from_xyz(0.0, 0.0, 5.0);
        let camera = world.spawn((exact_camera(Color::srgb(0.4, 0.6, 0.5)), target, place)).id();
        Self { headless, camera, field }
    }

    fn spawn(&mut self, place: Vec3, posterize: Posterize) -> Entity {
        let prop = (Prop(self.field.clone()), posterize, Transform::from_translation(place));
        self.headless.app.world_mut().spawn(prop).id()
    }

    fn set(&mut self, settings: impl Bundle) {
        self.headless.app.world_mut().entity_mut(self.camera).insert(settings);
    }

    fn capture(&mut self) -> RgbaImage {
        self.headless.wait_until_ready(Duration::from_secs(60)).unwrap();
        self.headless.capture().unwrap()
    }
}

/// Asserts that two frames are equal.
#[track_caller]
fn assert_same(found: &RgbaImage, expected: &RgbaImage, what: &str) {
    let differ = |(x, y, pixel): &(u32, u32, &image::Rgba<u8>)| expected.get_pixel(*x, *y) != *pixel;
    let wrong: Vec<_> = found.enumerate_pixels().filter(differ).map(|(x, y, _)| (x, y)).collect();
    assert!(wrong.is_empty(), "{what}: {} pixels differ, such as {:?}", wrong.len(), &wrong[..wrong.len().min(8)]);
}

const WIDE: Posterize = Posterize {
    filter: BilateralFilter { iterations: 4, radius: 6, spatial_sigma: 6.0, range_sigma: 50.0 },
    blend_steps: 3,
    softness: 0.2,
    min_opacity: 0.01,
    before_palette: BeforePalette::AsTrained,
    edges: EdgeSmoothing::Coverage,
    borders: BorderSmoothing::Off,
    steadiness: 0.0,
    method: None,
};

/// A prop that stays where another one was despawned next to it, or where it moved away from, looks as if it had always
/// been alone, with any number of samples.
#[test]
fn nothing_is_left_of_a_prop_that_is_gone() {
    for (msaa, hdr, stages) in [
        (Msaa::Off, false, false),
        (Msaa::Sample4, false, false),
        (Msaa::Sample4, true, false),
        (Msaa::Sample4, false, true),
    ] {
        let view = || {
            let mut view = View::new();
            view.set(msaa);
            if hdr {
                view.set(Hdr);
            }
            if stages {
                let idle = idle_stage(view.headless.app.world_mut());
                view.set(idle);
            }
            view.spawn(Vec3::new(-0.5, 0.1, 0.0), default());
            view
        };
        let alone = view().capture();
        let mut view = view();
        for place in [Vec3::new(0.4, 0.0, 0.5), Vec3::new(-0.5, 1.0, 0.0), Vec3::new(-1.4, 0.2, 0.5)] {
            let what = format!("{msaa:?}, HDR {hdr}, stages {stages}, {place}");
            let gone = view.spawn(place, default());
            assert!(view.capture() != alone, "{what}");
            view.headless.app.world_mut().get_mut::<Transform>(gone).unwrap().translation.z = 50.0;
            assert_same(&view.capture(), &alone, &format!("moved away, {what}"));
            view.headless.app.world_mut().get_mut::<Transform>(gone).unwrap().translation = place;
            view.capture();
            view.headless.app.world_mut().despawn(gone);
            assert_same(&view.capture(), &alone, &format!("despawned, {what}"));
        }
    }
}

/// The same view with fewer rays is the same, whatever was seen before.
#[test]
fn fewer_rays_do_not_depend_on_earlier_frames() {
    for (error, spacing) in [(0.02, 2), (0.3, 3), (f32::INFINITY, 8)] {
        let place = Vec3::new(0.1, -0.2, 0.0);
        let mut fresh = View::new();
        fresh.set(PropQuality { error, spacing, ..PropQuality::EXACT });
        fresh.spawn(place, WIDE);
        let expected = fresh.capture();
        let mut view = View::new();
        view.set(PropQuality { error, spacing, ..PropQuality::EXACT });
        let prop = view.spawn(Vec3::new(0.0, 0.0, 3.5), WIDE);
        assert!(view.capture() != expected);
        view.headless.app.world_mut().get_mut::<Transform>(prop).unwrap().translation = place;
        assert_same(&view.capture(), &expected, &format!("error {error}"));
    }
}

/// With fewer rays, outlines are complete: a prop looks the same when another prop, which is invisible, makes the
/// whole view be drawn.
#[test]
fn fewer_rays_cut_nothing() {
    for (error, spacing) in [(0.02, 2), (0.3, 3), (f32::INFINITY, 8)] {
        let mut view = View::new();
        view.set(PropQuality { error, spacing, ..PropQuality::EXACT });
        view.spawn(Vec3::new(0.1, -0.2, 0.0), WIDE);
        let alone = view.capture();
        let clear = view.headless.app.world_mut().resource_mut::<Assets<PlenOctree>>().add(field(1e-9));
        let everywhere = Transform::from_scale(Vec3::splat(8.0));
        view.headless.app.world_mut().spawn((Prop(clear), SolidOpacity::Never, everywhere));
        assert_same(&alone, &view.capture(), &format!("error {error}"));
    }
}
