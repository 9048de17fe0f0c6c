//! Tests the messages that report to the main world which fields the GPU holds.

use std::time::Duration;

use bevy::prelude::*;
use bevy_plenoctree::{
    FieldFailed, FieldReady, PlenOctree, PlenOctreePlugin, PlenOctreeSystems, Prop, PropError,
    headless::{Headless, HeadlessError},
};
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

fn cube(depth: u32) -> PlenOctree {
    let settings = BakeSettings { depth, basis: Basis::Rgba, density_samples: 1, ..default() };
    bake(&settings, |_| 1.0, |_| |_| DVec3::splat(0.5)).unwrap()
}

#[derive(Resource, Default)]
struct Received {
    ready: Vec<FieldReady>,
    failed: Vec<FieldFailed>,
}

fn receive(
    mut received: ResMut<Received>,
    mut ready: MessageReader<FieldReady>,
    mut failed: MessageReader<FieldFailed>,
) {
    received.ready.extend(ready.read());
    received.failed.extend(failed.read().cloned());
}

#[test]
fn fields_that_fit_and_fields_that_do_not_are_reported_once() {
    // Textures hold at most one mebibyte.
    let limits = wgpu::Limits { max_texture_dimension_2d: 256, ..wgpu::Limits::default() };
    let mut headless = Headless::with_limits(UVec2::splat(16), limits, |app| {
        app.add_plugins(PlenOctreePlugin)
            .init_resource::<Received>()
            .add_systems(PreUpdate, receive.after(PlenOctreeSystems::ReportFields));
    })
    .unwrap();
    let world = headless.app.world_mut();
    let [small, large] = [3, 6].map(|depth| world.resource_mut::<Assets<PlenOctree>>().add(cube(depth)));
    for field in [&small, &large] {
        world.spawn(Prop(field.clone()));
    }

    // Waiting fails at once for a field that does not fit.
    let error = headless.wait_until_ready(Duration::from_secs(60)).unwrap_err();
    let HeadlessError::Prop(PropError::TooLarge(error)) = error else { panic!("{error}") };
    assert_eq!((error.what, error.bytes, error.limit), ("coefficients", 16 << 18, Some(256 * 256 * 16)));
    (0..4).for_each(|_| headless.update());
    let received = headless.app.world().resource::<Received>();
    assert_eq!(received.ready, [FieldReady { field: small.id() }]);
    assert_eq!(received.failed, [FieldFailed { field: large.id(), error, only_level: false }]);

    // The reloaded field fits.
    *headless.app.world_mut().resource_mut::<Assets<PlenOctree>>().get_mut(&large).unwrap() = cube(4);
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    assert_eq!(headless.app.world().resource::<Received>().ready.last(), Some(&FieldReady { field: large.id() }));
}
