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
use scene::{
    COLOR, SHOWN, SIZE, SOLID, assert_near, at, fill, middle, orthographic, over, scene as scene_of, scene_with_meshes,
    spawn_square,
};

use crate::stage::pixels::linear;

const SKY: Color = Color::srgb(0.25, 0.5, 0.35);

/// Returns the exposure that multiplies light by `times`, relative to the default.
fn exposure(times: f32) -> Exposure {
    Exposure { ev100: Exposure::default().ev100 - times.log2() }
}

#[test]
fn exposure_scales_props_and_labels_but_not_the_background() {
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
    // Labels get brighter and darker, and stay where they are.
    fill(&mut scene, SOLID);
    scene.dress(Posterize { softness: 0.0, ..default() });
    for times in [0.125, 1.0, 1.25] {
        scene.set(exposure(times));
        let expected = (SHOWN[0].to_linear() * times).into();
        assert_near(middle(&scene.capture()), expected, 1, &format!("{times} times the light of labels"));
    }
}

/// Exposure brightens and darkens props as much as lit meshes.
#[test]
fn exposure_scales_a_prop_like_a_lit_mesh() {
    let mut scene = scene_with_meshes(SOLID);
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
