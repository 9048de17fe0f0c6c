//! Tests that views give back the GPU memory of passes when there is nothing left to draw.

use std::time::Duration;

use bevy::{
    camera::visibility::RenderLayers,
    prelude::*,
    render::{RenderApp, renderer::RenderDevice},
};
use bevy_plenoctree::{
    FieldPalette, LabelStages, Palettes, PlenOctree, PlenOctreePlugin, Posterize, PosterizeView, Prop, PropQuality,
    headless::{Headless, exact_camera},
};

use super::stage::{RED, SOLID, color, cube};

use crate::idle_stage::idle_stage;

const SIZE: u32 = 512;
/// The size of one texture with a byte per pixel.
const BYTE: u64 = (SIZE * SIZE) as u64;

/// Runs frames for half a second, and returns the bytes that are allocated on the GPU, if the backend reports them.
fn allocated(headless: &mut Headless) -> Option<u64> {
    for _ in 0..10 {
        headless.update();
        std::thread::sleep(Duration::from_millis(50));
    }
    let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    Some(device.wgpu_device().generate_allocator_report()?.total_allocated_bytes)
}

fn set(world: &mut World, entity: Entity, components: impl Bundle) {
    world.entity_mut(entity).insert(components);
}

#[test]
fn memory_goes_with_the_last_prop_in_view() {
    let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(cube(SOLID, RED));
    let palette = FieldPalette::from_colors([color(RED)]).unwrap();
    world.resource_mut::<Palettes>().insert(&field, palette);
    // The prop fills the view.
    let place = Transform::from_xyz(0.0, 0.0, 0.8);
    let camera = world.spawn((exact_camera(Color::BLACK), target, place)).id();
    // Keeps the field itself on the GPU.
    let prop = world.spawn((Prop(field.clone()), Posterize::default(), Visibility::Hidden)).id();
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    let Some(least) = allocated(&mut headless) else { return };

    type Change = fn(&mut World, Entity, Entity);
    let mut check = |what, show: Change, hide: Change, bytes: u64| {
        let world = headless.app.world_mut();
        show(world, camera, prop);
        let drawn = allocated(&mut headless).unwrap();
        assert!(drawn >= least + bytes * BYTE, "{what}: only {} bytes more", drawn - least);
        hide(headless.app.world_mut(), camera, prop);
        let left = allocated(&mut headless).unwrap();
        assert!(left < least + BYTE, "{what}: {} of {} bytes are left", left - least, drawn - least);
    };
    let show: Change = |world, _, prop| set(world, prop, Visibility::Visible);
    // Color, owner and depth, and two textures of the filter.
    check("hidden", show, |world, _, prop| set(world, prop, Visibility::Hidden), 48);
    check(
        "on another layer",
        show,
        |world, _, prop| set(world, prop, (RenderLayers::layer(1), Visibility::Hidden)),
        48,
    );
    check(
        "out of view",
        |world, _, prop| set(world, prop, (RenderLayers::layer(0), Visibility::Visible)),
        |world, _, prop| set(world, prop, Transform::from_xyz(100.0, 0.0, 0.0)),
        48,
    );
    check(
        "the camera is not active",
        |world, _, prop| set(world, prop, Transform::default()),
        |world, camera, _| world.get_mut::<Camera>(camera).unwrap().is_active = false,
        48,
    );
    check(
        "with stages",
        |world, camera, _| {
            world.get_mut::<Camera>(camera).unwrap().is_active = true;
            let idle = idle_stage(world);
            set(world, camera, idle);
        },
        |world, camera, prop| {
            world.entity_mut(camera).remove::<LabelStages>();
            set(world, prop, Visibility::Hidden);
        },
        48 + 24,
    );
    check(
        "a posterized view",
        |world, camera, prop| {
            let field = world.get::<Prop>(prop).unwrap().0.clone();
            set(world, camera, PosterizeView(field));
        },
        |world, camera, _| {
            world.entity_mut(camera).remove::<PosterizeView>();
        },
        48,
    );
    check(
        "props that overlap, with fewer rays",
        |world, camera, prop| {
            let field = world.get::<Prop>(prop).unwrap().0.clone();
            world.spawn((Prop(field), Transform::from_xyz(0.1, 0.0, 0.5), ChildOf(prop)));
            set(world, prop, Visibility::Visible);
            set(world, camera, PropQuality { error: 0.1, ..PropQuality::EXACT });
        },
        // The child is hidden as well.
        |world, _, prop| set(world, prop, Visibility::Hidden),
        48 + 26 + 20,
    );
    check(
        "despawned",
        show,
        |world, _, prop| {
            world.despawn(prop);
        },
        48 + 18,
    );
}

/// What one view of a prop costs is given back when another camera still sees it.
#[test]
fn overlaps_and_batches_are_paid_for_while_they_last() {
    let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(cube(SOLID, RED));
    // The prop fills the view.
    let place = Transform::from_xyz(0.0, 0.0, 0.8);
    let camera = world.spawn((exact_camera(Color::BLACK), target, place)).id();
    world.spawn(Prop(field.clone()));
    let other = world.spawn((Prop(field), Transform::from_xyz(2.0, 0.0, -2.0))).id();
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    let Some(least) = allocated(&mut headless) else { return };
    let mut check = |what, expected: f64, change: &mut dyn FnMut(&mut World)| {
        change(headless.app.world_mut());
        let bytes = allocated(&mut headless).unwrap().saturating_sub(least) as f64 / BYTE as f64;
        assert!((bytes - expected).abs() < 0.4, "{what}: {bytes} more bytes per pixel, expected {expected}");
    };
    // Props and their depths, for two rounds.
    check("overlapping", 16.0, &mut |world| world.get_mut::<Transform>(other).unwrap().translation.x = 0.25);
    check("side by side", 0.0, &mut |world| world.get_mut::<Transform>(other).unwrap().translation.x = 2.0);
    let quality = PropQuality { error: 0.1, ..PropQuality::EXACT };
    // Owners, a layer and a quarter, what is known of gaps, and their places.
    check("fewer rays", 25.5, &mut |world| set(world, camera, quality));
    check("all rays again", 0.0, &mut |world| set(world, camera, PropQuality::EXACT));
}
