//! Cameras and props in extreme places.

use bevy::prelude::*;
use bevy_plenoctree::Posterize;
use glam::{DMat3, DVec3};
use plenoctree::{camera::PinholeCamera, reference};

use super::stage::{Alone, SIZE, chain, looking};
use crate::stage::pixels::{assert_near, difference_of_prop, differing, middle};

/// The center ray runs along an axis, in faces, and through edges and corners of cells. Its components are 0, -0 or
/// tiny.
#[test]
fn rays_along_axes_and_in_faces() {
    let field = chain(6, 7, Some(0.7), 3.0);
    let mut stage = Alone::new(&field);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z] {
        for offset in [DVec3::ZERO, DVec3::splat(1e-30), DVec3::splat(-1e-30), DVec3::splat(0.5), DVec3::splat(0.25)] {
            let offset = offset - axis * offset.dot(axis);
            stage.check(&field, &looking(4.0 * axis + offset, offset), &format!("along {axis} at {offset}"));
        }
    }
    for target in [DVec3::ONE, DVec3::new(1.0, 1.0, 0.5), DVec3::new(-1.0, 1.0, 0.0)] {
        stage.check(&field, &looking(-3.0 * target, target), &format!("through {target}"));
    }
}

#[test]
fn cameras_on_faces_in_corners_and_inside() {
    let field = chain(5, 7, Some(0.7), 3.0);
    let mut stage = Alone::new(&field);
    for position in [
        DVec3::new(0.0, 0.0, 1.0),
        DVec3::ONE,
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::ZERO,
        DVec3::new(0.5, 0.5, 0.5),
        DVec3::new(0.1, -0.2, 0.3),
    ] {
        let camera = looking(position, DVec3::new(-0.4, -0.5, -0.6));
        stage.check(&field, &camera, &format!("from {position}"));
        let mirror = PinholeCamera { focal_x: -camera.focal_x, ..camera };
        stage.check(&field, &mirror, &format!("in a mirror, from {position}"));
    }
}

/// The faces of a mirrored box have the opposite winding. A camera inside the box still sees them from inside.
#[test]
fn a_camera_inside_a_mirrored_prop_sees_it() {
    let field = chain(3, 7, Some(0.7), 3.0);
    let mut stage = Alone::new(&field);
    let position = DVec3::new(0.1, -0.2, 0.3);
    let camera = looking(position, position + DVec3::X);
    let before = stage.see(&camera);
    stage.dress(Transform::from_scale(Vec3::new(1.0, 1.0, -1.0)));
    let other = position * DVec3::new(1.0, 1.0, -1.0);
    let mirrored = stage.see(&looking(other, other + DVec3::X));
    assert!(before.pixels().all(|pixel| pixel[2] > 50));
    let same = |(x, y, pixel): (u32, u32, &image::Rgba<u8>)| {
        pixel.0.iter().zip(mirrored.get_pixel(SIZE - 1 - x, y).0).all(|(a, b)| a.abs_diff(b) <= 1)
    };
    assert!(before.enumerate_pixels().all(same));
}

/// Cameras up to a million units away see the same as near ones, with a focal length that compensates for the distance.
#[test]
fn distant_cameras_see_what_near_ones_see() {
    let field = chain(5, 7, Some(0.7), 3.0);
    let mut stage = Alone::new(&field);
    // Bevy stores the camera's position and rotation in float32, whose steps eventually move the frame by a pixel.
    for (distance, most) in [(1e2, 0.6), (1e4, 0.6), (1e6, 8.0)] {
        let far = looking(distance * DVec3::new(0.48, 0.36, 0.8), DVec3::ZERO);
        let focal = 0.4 * f64::from(SIZE) * distance;
        let camera = PinholeCamera { focal_x: focal, focal_y: focal, ..far };
        let difference = stage.difference(&field, &camera);
        assert!(difference < most, "{distance} away: {difference}");
    }
}

/// Scaling a prop and the camera's distance by a large factor changes nothing.
#[test]
fn scaled_props_look_the_same() {
    let field = chain(4, 7, Some(0.7), 3.0);
    let near = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    let mut stage = Alone::new(&field);
    stage.check(&field, &near, "not scaled");
    let before = stage.see(&near);
    for posterize in [None, Some(Posterize::default())] {
        stage.dress(Transform::IDENTITY);
        if let Some(posterize) = posterize {
            stage.dress(posterize);
        }
        let before = if posterize.is_some() { stage.see(&near) } else { before.clone() };
        // The squares of the largest and smallest scales are no floats.
        for scale in [1e-20, 1e-4, 1e4, 1e20] {
            stage.dress(Transform::from_scale(Vec3::splat(scale)));
            let after = stage.see(&PinholeCamera { position: near.position * f64::from(scale), ..near });
            assert_eq!(differing(&before, &after, 1), 0, "scaled by {scale}, {posterize:?}");
        }
    }
}

/// A sheared prop looks as its field does from a sheared camera: rays stay straight, and optical depth is measured in
/// the field's own units.
#[test]
fn sheared_props_look_like_their_field() {
    let field = chain(4, 7, Some(0.7), 3.0);
    let camera = looking(DVec3::new(1.5, 1.0, 3.0), DVec3::ZERO);
    let mut stage = Alone::new(&field);
    // The parent is scaled unevenly and rotated, which shears the prop.
    let parent = Transform::from_scale(Vec3::new(1.2, 0.5, -0.9)).with_rotation(Quat::from_rotation_z(0.7));
    let own = Transform::from_rotation(Quat::from_rotation_x(0.4)).with_scale(Vec3::new(0.7, 1.1, 0.5));
    let above = stage.spawn((parent, Visibility::default()));
    stage.dress((own, ChildOf(above)));
    let field_from_world = (parent.to_matrix().as_dmat4() * own.to_matrix().as_dmat4()).inverse();
    let sheared = PinholeCamera {
        rotation: DMat3::from_mat4(field_from_world) * camera.rotation,
        position: field_from_world.transform_point3(camera.position),
        ..camera
    };
    let expected = reference::render(&field, &sheared);
    let covered = expected.opacity.iter().filter(|opacity| **opacity > 0.5).count();
    assert!(covered > 100, "{covered} pixels");
    let straight = reference::render(&field, &camera);
    let frame = stage.see(&camera);
    let [found, otherwise] = [expected, straight].map(|expected| difference_of_prop(&frame, &expected, DVec3::ZERO));
    assert!(found < 1.0 && otherwise > 10.0, "{found}, and {otherwise} if it were not sheared");
}

/// At 1e5 units from the origin, where a step of float32 is 0.008, a prop is drawn in place, to within that step.
#[test]
fn far_from_the_origin_of_the_world() {
    let field = chain(1, 0, Some(1e4), 1e4);
    let mut stage = Alone::new(&field);
    let place = DVec3::new(1e5, -1e5, 1e5);
    stage.dress(Transform::from_translation(place.as_vec3()));
    let camera = looking(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO);
    let frame = stage.see(&PinholeCamera { position: place + camera.position, ..camera });
    assert_near(middle(&frame), Color::srgb(0.25, 0.5, 1.0), 1, "the prop");
    assert_eq!(frame.get_pixel(1, 1).0, [0, 0, 0, 255]);
}

/// Renders into a target of this size.
fn draw_at(width: u32, height: u32) {
    let mut stage = Alone::new(&chain(1, 0, Some(1e4), 1e4));
    stage.dress(Posterize::default());
    stage.headless.resize(UVec2::new(width, height));
    let frame = stage.see(&looking(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO).resized(width, height));
    assert_eq!(frame.dimensions(), (width, height));
    let middle = frame.get_pixel(width / 2, height / 2);
    assert!(middle[3] == 255 && middle[2] > 100, "{width} x {height}: {middle:?}");
}

#[test]
fn targets_as_narrow_as_a_pixel() {
    [(1, 1), (4096, 3), (1, 4096)].into_iter().for_each(|(width, height)| draw_at(width, height));
}

#[test]
#[ignore = "slow: `scripts/test all` runs it"]
fn a_target_of_sixteen_million_pixels() {
    draw_at(4096, 4096);
}
