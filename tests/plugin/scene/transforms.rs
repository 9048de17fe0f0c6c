//! Tests props that are rotated, scaled, mirrored and sheared. Optical depth is measured in the field's own units, so
//! scaling does not change it.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use bevy::prelude::*;
use bevy_plenoctree::UpAxis;
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

use crate::stage::{
    fields::colored,
    sides::{BLUE, RED, SOLID, Sides, density, in_cube, seen},
};

/// Fog with an opacity of 6/10 on the left and 3/10 on the right, mirrored in various ways and rotated.
#[test]
fn a_mirrored_prop_is_mirrored() {
    let field = colored(
        4,
        |at| match at.abs().max_element() < 0.5 {
            true => density(if at.x < 0.0 { 0.6 } else { 0.3 }),
            false => 0.0,
        },
        |at| if at.x < 0.0 { RED } else { BLUE },
    );
    let mut stage = Sides::new();
    let prop = stage.spawn_prop(&field, ());
    stage.wait();
    let scaled = |x, y, z| Transform::from_scale(Vec3::new(x, y, z));
    for (transform, swapped) in [
        (scaled(1.0, 1.0, 1.0), false),
        (scaled(-1.0, 1.0, 1.0), true),
        (scaled(1.0, -1.0, 1.0), false),
        (scaled(1.0, -1.0, -1.0), false),
        (scaled(-1.0, -1.0, -1.0), true),
        (scaled(1.0, 1.0, -1.0).with_rotation(Quat::from_rotation_z(PI)), true),
    ] {
        stage.insert(prop, transform);
        stage.check(format!("{transform:?}"), |side, place| {
            let layer = if (place.x < 0.0) != swapped { (0.0, RED, 0.6) } else { (0.0, BLUE, 0.3) };
            seen(side, &in_cube(place).then_some(layer).into_iter().collect::<Vec<_>>())
        });
    }
}

fn sigmoid(x: DVec3) -> DVec3 {
    x.map(|x| 1.0 / (1.0 + (-x).exp()))
}

/// The color of every leaf is the sigmoid of the view direction: -z for the front camera, and z for the other one.
#[test]
fn highlights_rotate_with_the_prop() {
    let field = |up| {
        let settings = BakeSettings { depth: 2, basis: Basis::Sh4, up, ..default() };
        bake(&settings, |at| if at.abs().max_element() < 0.5 { SOLID } else { 0.0 }, |_| sigmoid).unwrap()
    };
    let rotated = Transform::from_rotation;
    let mut stage = Sides::new();
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (what, up, transform, direction) in [
        ("identity", UpAxis::Y, default(), [0.0, 0.0, -1.0]),
        // The y axis of the field is the -z axis of the scene.
        ("with z up", UpAxis::Z, default(), [0.0, 1.0, 0.0]),
        // The x axis of the prop becomes -z, and so on.
        ("rotated about y", UpAxis::Y, rotated(Quat::from_rotation_y(FRAC_PI_2)), [1.0, 0.0, 0.0]),
        ("rotated about x", UpAxis::Y, rotated(Quat::from_rotation_x(FRAC_PI_2)), [0.0, -1.0, 0.0]),
        ("rotated by 45 degrees", UpAxis::Y, rotated(Quat::from_rotation_y(FRAC_PI_4)), [half, 0.0, -half]),
        ("mirrored", UpAxis::Y, Transform::from_scale(Vec3::new(1.0, 1.0, -1.0)), [0.0, 0.0, 1.0]),
        // Rotated back, -z is along (1, 0, -1), and in a prop that is twice as wide, along (1/2, 0, -1).
        (
            "scaled and rotated",
            UpAxis::Y,
            rotated(Quat::from_rotation_y(FRAC_PI_4)).with_scale(Vec3::new(2.0, 1.0, 1.0)),
            [1.0 / 5f64.sqrt(), 0.0, -2.0 / 5f64.sqrt()],
        ),
    ] {
        let prop = stage.spawn_prop(&field(up), transform);
        stage.wait();
        stage.check(what, |side, place| {
            // The silhouettes differ, but all of them cover the middle.
            in_cube(2.0 * place).then_some(sigmoid(side.sign() * DVec3::from(direction)))
        });
        stage.world().despawn(prop);
    }
}
