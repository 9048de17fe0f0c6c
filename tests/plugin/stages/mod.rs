//! Tests where in the frame props are drawn, and how cameras change them, against results worked out by hand.

mod custom;
mod display;
mod everything;
mod objects;
mod scene;

use bevy::{
    camera::{Exposure, Hdr},
    prelude::*,
};
use bevy_plenoctree::{Posterize, PropPlacement};
use glam::DVec3;
use scene::{COLOR, SHOWN, SIZE, SOLID, assert_near, at, middle, orthographic, over, scene as scene_of, spawn_square};

use crate::stage::{pixels::linear, unlit};

const SKY: Color = Color::srgb(0.25, 0.5, 0.35);

/// Returns the exposure that multiplies light by `times`, relative to the default.
fn exposure(times: f32) -> Exposure {
    Exposure { ev100: Exposure::default().ev100 - times.log2() }
}

#[test]
fn exposure_scales_a_prop_but_not_the_background() {
    // Half of the light passes through.
    let mut scene = scene_of(std::f64::consts::LN_2);
    scene.set(orthographic());
    scene.set_background(SKY);
    for (hdr, msaa) in [(false, Msaa::Off), (false, Msaa::Sample4), (true, Msaa::Off), (true, Msaa::Sample4)] {
        scene.set_if(hdr, Hdr);
        scene.set(msaa);
        scene.set_if(false, Exposure::default());
        let what = format!("hdr {hdr}, {msaa:?}");
        assert_near(middle(&scene.capture()), over(0.5, COLOR, SKY, 1.0), 1, &what);
        for times in [0.25, 1.0, 1.6] {
            scene.set(exposure(times));
            let frame = scene.capture();
            assert_near(middle(&frame), over(0.5, COLOR, SKY, times), 1, &format!("{what}, {times} times the light"));
            assert_near(at(&frame, 1, 1), SKY, 1, &format!("{what}, next to the prop"));
        }
    }
}

#[test]
fn exposure_scales_labels_without_moving_them() {
    let mut scene = scene_of(SOLID);
    scene.dress(Posterize { softness: 0.0, ..default() });
    for times in [0.125, 1.0, 1.25] {
        scene.set(exposure(times));
        let expected = (SHOWN[0].to_linear() * times).into();
        assert_near(middle(&scene.capture()), expected, 1, &format!("{times} times the light"));
    }
}

/// Exposure brightens and darkens props as much as lit meshes.
#[test]
fn exposure_scales_a_prop_like_a_lit_mesh() {
    let mut scene = scene_of(SOLID);
    scene.set(Hdr);
    let matte = StandardMaterial { perceptual_roughness: 1.0, reflectance: 0.0, ..default() };
    spawn_square(&mut scene, Vec3::new(-0.8, 0.0, 0.0), 0.4, matte);
    scene.spawn(DirectionalLight { illuminance: 1200.0, ..default() });
    let mut light = |times| {
        scene.set(exposure(times));
        let frame = scene.capture();
        // The center of the square is at -0.8 / 3 / tan(22.5 degrees) of half the frame's width.
        [SIZE * 9 / 50, SIZE / 2].map(|x| linear(frame.get_pixel(x, SIZE / 2)).x)
    };
    let [mesh, prop] = light(1.0);
    for times in [0.3, 2.0] {
        let [brighter_mesh, brighter_prop] = light(times);
        let (mesh, prop) = (brighter_mesh / mesh, brighter_prop / prop);
        assert!((mesh - times).abs() < 0.03 * times, "the mesh itself: {mesh}, expected {times}");
        assert!((prop - mesh).abs() < 0.03 * times, "{prop}, expected {mesh}");
    }
}

#[test]
fn an_orthographic_camera_draws_a_prop_in_place() {
    let mut scene = scene_of(std::f64::consts::LN_2);
    let red = Color::srgb(0.8, 0.1, 0.1);
    let far = Transform::from_xyz(7.0, -4.0, 40.0);
    scene.set((orthographic(), far));
    scene.set_background(SKY);
    let place = Transform::from_xyz(7.25, -4.25, 33.0);
    scene.dress(place);
    // The square cuts through the lower half of the cube, at its center along z.
    spawn_square(&mut scene, place.translation - Vec3::Y, 2.0, unlit(red));
    for msaa in [Msaa::Off, Msaa::Sample4] {
        scene.set(msaa);
        let frame = scene.capture();
        for (x, y) in (0..SIZE).flat_map(|x| (0..SIZE).map(move |y| (x, y))) {
            let [across, down] = [x, y].map(|pixel| 2.0 * (pixel as f32 + 0.5) / SIZE as f32 - 1.25);
            let background = if (-1.0..1.0).contains(&across) && down > 0.0 { red } else { SKY };
            let opacity = match across.abs().max(down.abs()) < 0.5 {
                true if down > 0.0 => 1.0 - std::f32::consts::FRAC_1_SQRT_2,
                true => 0.5,
                false => 0.0,
            };
            assert_near(at(&frame, x, y), over(opacity, COLOR, background, 1.0), 1, &format!("{msaa:?}, {x}, {y}"));
        }
    }
}

/// From inside fog, opacity depends on the way from the near plane to its boundary.
#[test]
fn a_camera_inside_sees_the_rest_of_the_field() {
    let density = 1.7;
    let mut scene = scene_of(density);
    scene.set_background(SKY);
    let slope = std::f64::consts::FRAC_PI_8.tan();
    for eye in [DVec3::ZERO, DVec3::new(0.3, -0.4, 0.1)] {
        scene.set(Transform::from_translation(eye.as_vec3()));
        let frame = scene.capture();
        for (x, y) in (0..SIZE).flat_map(|x| (0..SIZE).map(move |y| (x, y))) {
            let [across, down] = [x, y].map(|pixel| 2.0 * (f64::from(pixel) + 0.5) / f64::from(SIZE) - 1.0);
            let direction = DVec3::new(across * slope, -down * slope, -1.0).normalize();
            let way = ((0.5 * direction.signum() - eye) / direction).min_element();
            let way = way - 0.1 / -direction.z;
            let expected = over((1.0 - (-density * way).exp()) as f32, COLOR, SKY, 1.0);
            assert_near(at(&frame, x, y), expected, 1, &format!("from {eye}, {x}, {y}"));
        }
    }
}

#[test]
fn both_stages_draw_the_same_if_no_effect_runs_between_them() {
    let mut scene = scene_of(2.0);
    scene.set_background(SKY);
    for msaa in [Msaa::Off, Msaa::Sample4] {
        scene.set((msaa, PropPlacement::Scene));
        let among_the_scene = scene.capture();
        scene.set(PropPlacement::Display);
        assert!(scene.capture() == among_the_scene, "{msaa:?}");
    }
}
