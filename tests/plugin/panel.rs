//! Tests in which camera's view the palette panel is shown.

use std::time::Duration;

use bevy::{camera::Viewport, prelude::*};
use bevy_plenoctree::{
    PlenOctreePlugin,
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

#[test]
fn the_panel_is_shown_in_the_chosen_view() {
    let mut headless = Headless::new(SIZE, |app| {
        app.add_plugins((PlenOctreePlugin, PalettePanelPlugin));
    })
    .unwrap();
    // bevy_egui would make two cameras that exist before the first frame primary, and panic.
    headless.update();
    let target = headless.target();
    let world = headless.app.world_mut();
    let [left, right] = [0, 1].map(|index| {
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
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    let mut show = |camera| {
        headless.app.world_mut().resource_mut::<PalettePanel>().camera = camera;
        (0..5).for_each(|_| headless.update());
        covered(&headless.capture().unwrap())
    };
    let [first, second] = show(None);
    assert!(first > 1000 && second == 0, "in the first view: {first}, {second}");
    for (camera, is_right) in [(right, true), (left, false), (right, true)] {
        let [a, b] = show(Some(camera));
        let (shown, hidden) = if is_right { (b, a) } else { (a, b) };
        assert!(shown > 1000 && hidden == 0, "right: {is_right}: {a}, {b}");
    }
}
