//! Tests that a frame shows nothing of the frames before it.

use bevy::{camera::Hdr, prelude::*};
use bevy_plenoctree::{
    BeforePalette, BilateralFilter, FieldPalette, Palettes, PlenOctree, Posterize, Prop, PropQuality, SolidOpacity,
};
use glam::DVec3;
use image::RgbaImage;

use crate::stage::{Stage, fields::colored, pixels::assert_same};

const SIZE: u32 = 128;

/// Bakes a cube from -1/2 to 1/2 whose color differs from place to place.
fn field(density: f64) -> PlenOctree {
    let inside = move |at: DVec3| if at.abs().max_element() < 0.5 { density } else { 0.0 };
    colored(4, inside, |at| 0.5 + 0.5 * (9.0 * at).map(f64::sin))
}

struct View {
    stage: Stage,
    field: Handle<PlenOctree>,
}

impl View {
    fn new() -> Self {
        let mut stage = Stage::new(SIZE);
        let field = stage.add(field(30.0));
        let colors = [Color::srgb(0.8, 0.2, 0.1), Color::srgb(0.1, 0.3, 0.8), Color::srgb(0.9, 0.9, 0.2)];
        stage.world().resource_mut::<Palettes>().insert(&field, FieldPalette::from_colors(colors).unwrap());
        stage.set_background(Color::srgb(0.4, 0.6, 0.5));
        stage.set(Transform::from_xyz(0.0, 0.0, 5.0));
        Self { stage, field }
    }

    fn spawn(&mut self, place: Vec3, posterize: Posterize) -> Entity {
        self.stage.spawn((Prop(self.field.clone()), posterize, Transform::from_translation(place)))
    }

    fn place(&mut self, prop: Entity, place: Vec3) {
        self.stage.world().get_mut::<Transform>(prop).unwrap().translation = place;
    }

    fn capture(&mut self) -> RgbaImage {
        self.stage.wait();
        self.stage.capture()
    }
}

fn wide() -> Posterize {
    let filter = BilateralFilter { radius: 6, taps: 8, spatial_sigma: 6.0, range_sigma: 50.0, ..default() };
    let before_palette = BeforePalette::AsTrained;
    Posterize { filter, min_opacity: 0.01, before_palette, ..Posterize::paper() }
}

/// A prop that stays where another one was despawned next to it, or where it moved away from, looks as if it had always
/// been alone, with any number of samples.
#[test]
fn nothing_is_left_of_a_prop_that_is_gone() {
    let view = || {
        let mut view = View::new();
        view.spawn(Vec3::new(-0.5, 0.1, 0.0), default());
        view
    };
    let mut used = view();
    for (msaa, hdr, stages) in [
        (Msaa::Off, false, false),
        (Msaa::Sample4, false, false),
        (Msaa::Sample4, true, false),
        (Msaa::Sample4, false, true),
    ] {
        let mut fresh = view();
        for View { stage, .. } in [&mut fresh, &mut used] {
            stage.set(msaa);
            stage.set_if(hdr, Hdr);
            let idle = stage.idle_stage();
            stage.set_if(stages, idle);
        }
        let (view, alone) = (&mut used, fresh.capture());
        for place in [Vec3::new(0.4, 0.0, 0.5), Vec3::new(-0.5, 1.0, 0.0), Vec3::new(-1.4, 0.2, 0.5)] {
            let what = format!("{msaa:?}, HDR {hdr}, stages {stages}, {place}");
            let gone = view.spawn(place, default());
            assert!(view.capture() != alone, "{what}");
            view.place(gone, 50.0 * Vec3::Z);
            assert_same(&view.capture(), &alone, &format!("moved away, {what}"));
            view.place(gone, place);
            view.capture();
            view.stage.world().despawn(gone);
            assert_same(&view.capture(), &alone, &format!("despawned, {what}"));
        }
    }
}

/// The same view with fewer rays is the same, whatever was seen before.
#[test]
fn fewer_rays_do_not_depend_on_earlier_frames() {
    let mut view = View::new();
    let prop = view.spawn(Vec3::ZERO, wide());
    for ray_tolerance in [0.02, 0.3, f32::INFINITY] {
        let place = Vec3::new(0.1, -0.2, 0.0);
        let mut fresh = View::new();
        fresh.stage.set(PropQuality { ray_tolerance, ..PropQuality::EXACT });
        fresh.spawn(place, wide());
        let expected = fresh.capture();
        view.stage.set(PropQuality { ray_tolerance, ..PropQuality::EXACT });
        view.place(prop, 3.5 * Vec3::Z);
        assert!(view.capture() != expected);
        view.place(prop, place);
        assert_same(&view.capture(), &expected, &format!("tolerance {ray_tolerance}"));
    }
}

/// With fewer rays, outlines are complete: a prop looks the same when another prop, which is invisible, makes the
/// whole view be drawn.
#[test]
fn fewer_rays_cut_nothing() {
    let mut view = View::new();
    view.spawn(Vec3::new(0.1, -0.2, 0.0), wide());
    for ray_tolerance in [0.02, 0.3, f32::INFINITY] {
        view.stage.clear();
        view.stage.set(PropQuality { ray_tolerance, ..PropQuality::EXACT });
        let alone = view.capture();
        let everywhere = Transform::from_scale(Vec3::splat(8.0));
        view.stage.spawn_prop(&field(1e-9), (SolidOpacity::Never, everywhere));
        assert_same(&alone, &view.capture(), &format!("tolerance {ray_tolerance}"));
    }
}
