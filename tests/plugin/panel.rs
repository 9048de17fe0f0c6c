//! Tests in which camera's view the palette panel is shown.

use std::time::Duration;

use bevy::{camera::Viewport, prelude::*};
use bevy_plenoctree::{
    PlenOctreePlugin, Prop,
    headless::{Headless, exact_camera},
    panel::{PalettePanel, PalettePanelPlugin},
};
use image::RgbaImage;

const SIZE: UVec2 = UVec2::new(400, 300);
const BACKGROUND: [u8; 4] = [0, 128, 255, 255];

/// Returns how many pixels of the left and the right view show something.
fn covered(frame: &RgbaImage) -> [usize; 2] {
    let half = SIZE.x / 2;
    [0, half].map(|begin| {
        let pixels = (begin..begin + half).flat_map(|x| (0..SIZE.y).map(move |y| (x, y)));
        pixels.filter(|(x, y)| frame.get_pixel(*x, *y).0 != BACKGROUND).count()
    })
}

/// Returns an app with a left and a right view.
fn views() -> (Headless, [Entity; 2]) {
    let mut headless = Headless::new(SIZE, |app| {
        app.add_plugins((PlenOctreePlugin, PalettePanelPlugin));
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let cameras = [0, 1].map(|index| {
        let camera = world.spawn((exact_camera(Color::srgb_u8(0, 128, 255)), target.clone())).id();
        let mut settings = world.get_mut::<Camera>(camera).unwrap();
        settings.order = index;
        settings.viewport = Some(Viewport {
            physical_position: UVec2::new(index as u32 * SIZE.x / 2, 0),
            physical_size: UVec2::new(SIZE.x / 2, SIZE.y),
            ..default()
        });
        camera
    });
    (headless, cameras)
}

/// Chooses a view, and returns how many pixels of the left and the right one show something.
fn show(headless: &mut Headless, camera: Option<Entity>) -> [usize; 2] {
    headless.app.world_mut().resource_mut::<PalettePanel>().camera = camera;
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    (0..5).for_each(|_| headless.update());
    covered(&headless.capture().unwrap())
}

#[test]
fn the_panel_is_shown_in_the_chosen_view() {
    let (mut headless, [left, right]) = views();
    let [first, second] = show(&mut headless, None);
    assert!(first > 1000 && second == 0, "in the first view: {first}, {second}");
    for (camera, is_right) in [(right, true), (left, false), (right, true)] {
        let [a, b] = show(&mut headless, Some(camera));
        let (shown, hidden) = if is_right { (b, a) } else { (a, b) };
        assert!(shown > 1000 && hidden == 0, "right: {is_right}: {a}, {b}");
    }
}

/// An entity may be chosen before it is a prop.
#[test]
fn the_panel_keeps_the_choice_of_the_app() {
    let (mut headless, _) = views();
    let world = headless.app.world_mut();
    world.spawn(Prop(Handle::default()));
    let chosen = world.spawn_empty().id();
    world.resource_mut::<PalettePanel>().prop = Some(chosen);
    (0..5).for_each(|_| headless.update());
    assert_eq!(headless.app.world().resource::<PalettePanel>().prop, Some(chosen));
}

/// A view may be chosen before the first frame. Once its camera is gone, the panel moves to another one.
#[test]
fn the_panel_leaves_a_view_that_is_gone() {
    let (mut headless, [_, right]) = views();
    let [left, chosen] = show(&mut headless, Some(right));
    assert!(left == 0 && chosen > 1000, "in the right view: {left}, {chosen}");
    headless.app.world_mut().despawn(right);
    let [left, _] = show(&mut headless, Some(right));
    assert!(left > 1000, "in the left view: {left}");
}
