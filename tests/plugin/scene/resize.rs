//! Tests targets that change their size. Bevy tells cameras of a new size a frame later, unless they are new or change
//! themselves, so that for a frame, cameras of one target disagree about its size.

use bevy::{
    camera::{Hdr, Viewport},
    core_pipeline::prepass::{DepthPrepass, MotionVectorPrepass},
    prelude::*,
    render::render_resource::Extent3d,
};
use bevy_plenoctree::{Ink, Posterize, PosterizeView, PropPlacement, headless::exact_camera};
use image::RgbaImage;

use crate::stage::sides::{BACKGROUND, BLUE, GREEN, SOLID, Sides, color, cube, density, flat};

/// What happens to another camera in the frame in which the target changes its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    Spawn,
    Zoom,
    Viewport,
}

/// Resizes the target while something happens to the first or the second camera, or a third one is spawned. Returns the
/// frame after that.
fn resize(stage: &mut Sides, size: UVec2, event: Event, changing: Entity, settings: impl Bundle) -> RgbaImage {
    let (target, cameras) = (stage.headless.target(), stage.cameras);
    // As windows and games do it. `Headless::resize` tells cameras at once.
    let image = target.as_image().unwrap().id();
    let extent = Extent3d { width: size.x, height: size.y, ..default() };
    stage.world().resource_mut::<Assets<Image>>().get_mut(image).unwrap().resize(extent);
    let mut spawned = None;
    match event {
        Event::Spawn => {
            let camera = (exact_camera(color(BACKGROUND)), target, flat(), Transform::from_xyz(0.0, 0.0, 5.0));
            let camera = stage.spawn(camera);
            stage.insert(camera, settings);
            // It draws first, and the others draw over it.
            stage.world().get_mut::<Camera>(camera).unwrap().order = -1;
            spawned = Some(camera);
        }
        Event::Zoom => stage.world().get_mut::<Projection>(changing).unwrap().set_changed(),
        Event::Viewport => {
            let physical_size = size - UVec2::new(5, 7);
            let viewport = Viewport { physical_position: UVec2::new(3, 2), physical_size, ..default() };
            stage.world().get_mut::<Camera>(changing).unwrap().viewport = Some(viewport);
        }
    }
    let capture = |stage: &mut Sides| {
        stage.headless.capture().unwrap_or_else(|error| panic!("{size}, {event:?}, {changing}: {error}"))
    };
    capture(stage);
    for camera in cameras {
        stage.world().get_mut::<Camera>(camera).unwrap().viewport = None;
    }
    if let Some(camera) = spawned {
        stage.world().despawn(camera);
    }
    // Rendering stops after the first error, which is reported a frame later.
    capture(stage)
}

/// From large to small, from small to large, and both at once.
const SIZES: [UVec2; 3] = [UVec2::splat(40), UVec2::new(41, 17), UVec2::new(17, 25)];

/// A solid prop, haze before it, and a pane before both, all of them larger than the view.
fn filled() -> Sides {
    let mut stage = Sides::with_meshes();
    let [first, second] = stage.cameras;
    let large = Transform::from_scale(Vec3::splat(8.0));
    stage.spawn_prop(&cube(SOLID, GREEN), large);
    stage.spawn_prop(&cube(density(0.4), BLUE), large.with_translation(Vec3::new(0.25, 0.25, 0.5)));
    stage.spawn_rectangle((-8.0, -8.0), (8.0, 8.0), 4.75, BLUE, 0.5);
    for camera in [first, second] {
        stage.world().get_mut::<Camera>(camera).unwrap().viewport = None;
    }
    stage.world().get_mut::<Camera>(second).unwrap().clear_color = ClearColorConfig::None;
    stage.wait();
    stage
}

/// No frame has an error, and the next ones show what they always show.
#[test]
fn cameras_may_disagree_about_the_size_of_their_target() {
    let mut stage = filled();
    let [first, second] = stage.cameras;
    for (what, msaa, place) in [
        ("as trained", Msaa::Off, PropPlacement::Scene),
        ("as trained", Msaa::Sample4, PropPlacement::Display),
        ("posterized", Msaa::Sample4, PropPlacement::Scene),
        ("view", Msaa::Off, PropPlacement::Display),
    ] {
        match what {
            "posterized" => stage.dress((Posterize::default(), Ink::default())),
            "view" => {
                let everything = (PosterizeView(stage.field()), Posterize::default());
                stage.insert(second, everything);
            }
            _ => {}
        }
        stage.set_both((msaa, place));
        stage.wait();
        println!("{what}, {msaa:?}, {place:?}");
        for event in [Event::Spawn, Event::Zoom, Event::Viewport] {
            for (index, size) in SIZES.into_iter().enumerate() {
                let changing = [first, second][index % 2];
                let after = resize(&mut stage, size, event, changing, (msaa, place));
                assert_eq!(after.dimensions(), (size.x, size.y));
                let middle = after.get_pixel(size.x / 2, size.y / 2);
                assert!(after.pixels().all(|pixel| (0..3).all(|c| pixel[c].abs_diff(middle[c]) < 40)), "{event:?}");
            }
        }
    }
}

/// Cameras that differ in format, samples and prepasses have textures of their own, but share others.
#[test]
fn cameras_of_every_kind_may_disagree() {
    let mut stage = filled();
    let [first, second] = stage.cameras;
    stage.dress(Posterize::default());
    for (kind, msaa) in [("prepasses", Msaa::Sample4), ("hdr", Msaa::Off), ("samples", Msaa::Off)] {
        println!("{kind}, {msaa:?}");
        stage.insert(first, msaa);
        let mut other = stage.world().entity_mut(second);
        other.remove::<(Hdr, DepthPrepass, MotionVectorPrepass)>().insert(msaa);
        match kind {
            "hdr" => drop(other.insert(Hdr)),
            "samples" => drop(other.insert(Msaa::Sample4)),
            _ => drop(other.insert((DepthPrepass, MotionVectorPrepass))),
        }
        stage.wait();
        for event in [Event::Spawn, Event::Zoom, Event::Viewport] {
            for (index, size) in SIZES.into_iter().enumerate() {
                let changing = [first, second][index % 2];
                resize(&mut stage, size, event, changing, msaa);
            }
        }
    }
}

/// A headless app shows its new size in the next frame, and cameras know it.
#[test]
fn headless_apps_are_resized_at_once() {
    let mut stage = filled();
    for size in SIZES {
        stage.headless.resize(size);
        let first = stage.capture();
        let camera = stage.cameras[0];
        assert_eq!(stage.world().get::<Camera>(camera).unwrap().physical_target_size(), Some(size));
        assert_eq!(first, stage.capture(), "{size}");
    }
}
