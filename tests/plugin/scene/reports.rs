//! Tests the messages that report to the main world which fields the GPU holds.

use bevy::prelude::*;
use bevy_plenoctree::{FieldFailed, FieldReady, PlenOctree, Prop, PropError, headless::HeadlessError};
use glam::DVec3;

use crate::stage::{PATIENCE, Stage, fields::colored, hear};

fn cube(depth: u32) -> PlenOctree {
    colored(depth, |_| 1.0, |_| DVec3::splat(0.5))
}

#[test]
fn fields_that_fit_and_fields_that_do_not_are_reported_once() {
    // Textures hold at most one mebibyte.
    let limits = wgpu::Limits { max_texture_dimension_2d: 256, ..wgpu::Limits::default() };
    let mut stage = Stage::limited(16, limits, |app| {
        hear::<FieldReady>(app);
        hear::<FieldFailed>(app);
    });
    // Nothing sees them.
    stage.close();
    let [small, large] = [3, 6].map(|depth| {
        let prop = stage.spawn_prop(&cube(depth), ());
        stage.get::<Prop>(prop).0.clone()
    });

    // Waiting fails at once for a field that does not fit.
    let error = stage.headless.wait_until_ready(PATIENCE).unwrap_err();
    let HeadlessError::Prop(PropError::TooLarge(error)) = error else { panic!("{error}") };
    assert_eq!((error.what, error.bytes, error.limit), ("coefficients", 16 << 18, Some(256 * 256 * 16)));
    stage.update(4);
    assert_eq!(stage.heard::<FieldReady>(), [FieldReady { field: small.id() }]);
    assert_eq!(stage.heard::<FieldFailed>(), [FieldFailed { field: large.id(), error, only_level: false }]);

    // The reloaded field fits.
    *stage.world().resource_mut::<Assets<PlenOctree>>().get_mut(&large).unwrap() = cube(4);
    stage.wait();
    assert_eq!(stage.heard::<FieldReady>().last(), Some(&FieldReady { field: large.id() }));
}
