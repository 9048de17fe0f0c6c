//! Tests that transparent objects look the same over props at [`PropPlacement::Display`] as at
//! [`PropPlacement::Scene`], where Bevy draws them over props itself.

use bevy::{
    camera::{Hdr, MsaaWriteback, Viewport},
    core_pipeline::{oit::OrderIndependentTransparencySettings, tonemapping::Tonemapping},
    post_process::bloom::Bloom,
    prelude::*,
};
use bevy_plenoctree::{EdgeSmoothing, Posterize, PropPlacement, SolidOpacity, headless::exact_camera};
use image::RgbaImage;

use super::scene::{
    SIZE, SOLID, Stage, at, cube, differing, fill, orthographic, palette, scene_with_meshes, spawn_square,
};
use crate::stage::{
    fields::included,
    pixels::{encoded, linear, places, steps},
    unlit,
};

const SKY: Color = Color::srgb(0.25, 0.5, 0.35);
const PANE: Color = Color::srgba(0.8, 0.5, 0.2, 0.6);
const MODES: [AlphaMode; 4] = [AlphaMode::Blend, AlphaMode::Premultiplied, AlphaMode::Add, AlphaMode::Multiply];

fn material(alpha_mode: AlphaMode) -> StandardMaterial {
    StandardMaterial { base_color: PANE, unlit: true, cull_mode: None, alpha_mode, ..default() }
}

/// Captures the frame at both placements.
fn both(scene: &mut Stage) -> [RgbaImage; 2] {
    [PropPlacement::Scene, PropPlacement::Display].map(|placement| {
        scene.set(placement);
        scene.capture()
    })
}

/// Every pixel is compared: inside the prop, at its edges, and before the sky. One pane is before the prop, one in it,
/// and one behind it.
#[test]
fn every_blend_mode_looks_as_in_the_scene() {
    let mut scene = scene_with_meshes(SOLID);
    scene.set_background(SKY);
    let panes = [
        spawn_square(&mut scene, Vec3::new(0.2, 0.3, 1.0), 0.8, default()),
        spawn_square(&mut scene, Vec3::new(-0.3, -0.1, 0.4), 0.9, default()),
        spawn_square(&mut scene, Vec3::new(0.3, -0.6, -1.0), 1.2, default()),
    ];
    let corner = Viewport { physical_position: UVec2::new(5, 2), physical_size: UVec2::new(40, 33), ..default() };
    let turned = Transform::from_rotation(Quat::from_euler(EulerRot::XYZ, 0.4, 0.6, 0.1));
    let kinds = [
        (None, Msaa::Off, true, false, None),
        (None, Msaa::Sample4, false, true, Some(corner.clone())),
        (Some(EdgeSmoothing::Off), Msaa::Off, false, true, Some(corner.clone())),
        (Some(EdgeSmoothing::Off), Msaa::Sample4, true, false, None),
        (Some(EdgeSmoothing::Coverage), Msaa::Off, false, false, None),
        (Some(EdgeSmoothing::Coverage), Msaa::Sample4, true, true, Some(corner)),
    ];
    for (edges, msaa, hdr, is_flat, viewport) in kinds {
        scene.camera_mut().viewport = viewport.clone();
        scene.set((msaa, if is_flat { orthographic() } else { default() }));
        scene.set_if(hdr, Hdr);
        // Without `Hdr`, objects are tonemapped one by one.
        scene.set(if hdr { Tonemapping::None } else { Tonemapping::AcesFitted });
        scene.dress(if edges.is_some() { turned } else { default() });
        if let Some(edges) = edges {
            scene.dress(Posterize { edges, ..default() });
        }
        scene.set(PropPlacement::Scene);
        for pane in panes {
            scene.world().entity_mut(pane).insert(Visibility::Hidden);
        }
        let without = scene.capture();
        for pane in panes {
            scene.world().entity_mut(pane).insert(Visibility::Visible);
        }
        for mode in MODES {
            let world = scene.world();
            let material = world.resource_mut::<Assets<StandardMaterial>>().add(material(mode));
            for pane in panes {
                world.entity_mut(pane).insert(MeshMaterial3d(material.clone()));
            }
            let what = format!("{mode:?}, {edges:?}, {msaa:?}, HDR {hdr}, flat {is_flat}, {viewport:?}");
            let [expected, found] = both(&mut scene);
            assert!(differing(&expected, &without, 16) > 200, "{what}: panes do not show");
            assert_eq!(differing(&found, &expected, 1), 0, "{what}");
        }
    }
}

/// Thin parts are blended with what is behind in encoded sRGB, and objects with both in linear light.
#[test]
fn objects_are_in_front_of_thin_parts() {
    let mut scene = scene_with_meshes(0.3);
    scene.set_background(SKY);
    let stages = scene.idle_stage();
    for (density, has_stages) in [(0.3, false), (0.3, true), (1.0, false)] {
        fill(&mut scene, density);
        scene.set_if(has_stages, stages.clone());
        for mode in MODES {
            let pane = spawn_square(&mut scene, Vec3::new(0.0, 0.2, 1.0), 0.4, material(mode));
            let [expected, found] = both(&mut scene);
            scene.world().despawn(pane);
            let without = scene.capture();
            let what = format!("{mode:?}, density {density}, stages {has_stages}");
            assert!(differing(&expected, &without, 16) > 60, "{what}: the pane does not show");
            assert_eq!(differing(&found, &expected, 1), 0, "{what}");
        }
    }
}

/// With multisampling, objects end at the edges of opaque meshes before them as they do in the scene.
#[test]
fn objects_end_at_edges_of_meshes() {
    let mut scene = scene_with_meshes(SOLID);
    scene.set_background(SKY);
    scene.set(Msaa::Sample4);
    let turned = Transform::from_xyz(0.0, 0.0, 1.2).with_rotation(Quat::from_rotation_z(0.3));
    scene.spawn_mesh(Rectangle::new(0.3, 0.3), unlit(Color::WHITE), turned);
    // Thinner than a pixel.
    let bar = Transform::from_xyz(0.0, 0.3, 1.2).with_rotation(Quat::from_rotation_z(0.15));
    scene.spawn_mesh(Cuboid::new(0.4, 0.02, 0.01), unlit(Color::srgb(0.9, 0.9, 0.2)), bar);
    for (density, is_posterized, hdr) in
        [(SOLID, false, false), (SOLID, true, false), (SOLID, true, true), (0.3, true, true)]
    {
        fill(&mut scene, density);
        scene.set_if(hdr, Hdr);
        if is_posterized {
            scene.dress(Posterize::default());
        }
        let most = |[a, b]: &[RgbaImage; 2]| (0..u8::MAX).find(|step| differing(a, b, *step) == 0).unwrap_or(u8::MAX);
        let without = both(&mut scene);
        for mode in MODES {
            let pane = StandardMaterial { base_color: Color::srgba(0.2, 0.1, 0.5, 0.9), ..material(mode) };
            let pane = spawn_square(&mut scene, Vec3::new(0.0, 0.0, 1.0), 0.6, pane);
            let with = both(&mut scene);
            scene.world().despawn(pane);
            let what = format!("{mode:?}, density {density}, posterized {is_posterized}, HDR {hdr}");
            assert!(differing(&with[0], &without[0], 8) > 60, "{what}: the pane does not show");
            let found = [most(&without), most(&with)];
            // A few pixels at corners of meshes are off by more than 8.
            assert!(found[0] <= 4 && found[1] <= 24, "{what}: off by {found:?}");
        }
    }
}

/// With multisampling, edges of meshes before props look as in the scene, and as with more pixels, where they cross
/// edges of props, too.
#[test]
fn meshes_before_props_end_as_in_the_scene() {
    /// How many times as many pixels there are along a side.
    const FINER: u32 = 4;
    let mut scene = Stage::with_meshes(FINER * SIZE);
    let turned = Transform::from_rotation(Quat::from_rotation_z(0.3));
    scene.spawn_prop(&cube(SOLID), (Posterize::default(), turned));
    scene.paint(palette());
    scene.set((Msaa::Sample4, Transform::from_xyz(0.0, 0.0, 3.0)));
    // A wall behind all.
    spawn_square(&mut scene, Vec3::new(0.0, 0.0, -1.0), 9.0, unlit(SKY));
    for bar in 0..12 {
        let (angle, color) = (0.52 * bar as f32, 0.09 * bar as f32);
        let place = Transform::from_rotation(Quat::from_rotation_z(angle)) * Transform::from_xyz(0.36, 0.0, 1.0);
        let place = place * Transform::from_rotation(Quat::from_rotation_z(1.3 * angle));
        let size = Cuboid::new(0.02 + 0.006 * bar as f32, 0.12, 0.02);
        scene.spawn_mesh(size, unlit(Color::srgb(color, 1.0 - color, 0.2)), place);
    }
    scene.wait();
    let fine = scene.capture();
    scene.headless.resize(UVec2::splat(SIZE));
    let mean = |x: u32, y: u32| {
        let part = places(FINER, FINER).map(|(i, j)| linear(fine.get_pixel(FINER * x + i, FINER * y + j)));
        255.0 * encoded(LinearRgba::from_vec3(part.sum::<Vec3>() / (FINER * FINER) as f32))
    };
    let error = |frame: &RgbaImage| {
        let errors = places(SIZE, SIZE).map(|(x, y)| (steps(frame.get_pixel(x, y)) - mean(x, y)).length_squared());
        errors.sum::<f64>().sqrt()
    };
    // Without a depth, less is known about what is before the prop.
    for (solid, most_off) in [(SolidOpacity::default(), [8, 0]), (SolidOpacity::Never, [8, 1])] {
        scene.dress(solid);
        let [expected, found] = both(&mut scene);
        let errors = [error(&found), error(&expected)];
        let off = [8, 24].map(|step| differing(&found, &expected, step));
        println!("{solid:?}: off {off:?}, errors {errors:?}");
        assert!(errors[0] <= 1.02 * errors[1], "{solid:?}: errors at the display and in the scene: {errors:?}");
        assert!(off[0] <= most_off[0] && off[1] <= most_off[1], "{solid:?}: off by more than 8 and 24: {off:?}");
    }
}

/// An object elsewhere changes nothing at the edges of meshes, whatever colors the prop has there.
#[test]
fn objects_change_only_what_is_behind_them() {
    let mut scene = Stage::with_meshes(96);
    scene.spawn_prop(&included("drum"), ());
    scene.paint(palette());
    scene.set_background(SKY);
    scene.set((Msaa::Sample4, PropPlacement::Display, Transform::from_xyz(0.0, 0.6, 3.5)));
    let turned = Transform::from_xyz(0.1, 0.0, 1.5).with_rotation(Quat::from_rotation_z(0.5));
    scene.spawn_mesh(Cuboid::new(0.15, 4.0, 0.1), unlit(Color::srgb(0.96, 0.96, 0.28)), turned);
    let pane = spawn_square(&mut scene, Vec3::new(-1.3, 2.0, 0.0), 0.2, material(AlphaMode::Blend));
    for (hdr, is_posterized) in [(false, false), (false, true), (true, false), (true, true)] {
        scene.set_if(hdr, Hdr);
        if is_posterized {
            scene.dress(Posterize::default());
        } else {
            scene.undress::<Posterize>();
        }
        let [with, without] = [Visibility::Visible, Visibility::Hidden].map(|visibility| {
            scene.insert(pane, visibility);
            scene.wait();
            scene.capture()
        });
        let corner = differing(&with, &without, 1);
        assert!((1..60).contains(&corner), "HDR {hdr}, posterized {is_posterized}: {corner} pixels differ");
        let is_corner = |x: u32, y: u32| x < 24 && y < 24;
        let elsewhere = places(96, 96).filter(|(x, y)| !is_corner(*x, *y));
        let most =
            elsewhere.map(|(x, y)| (0..3).map(|c| with.get_pixel(x, y)[c].abs_diff(without.get_pixel(x, y)[c])).max());
        assert!(most.max() <= Some(Some(1)), "HDR {hdr}, posterized {is_posterized}");
    }
}

/// A prop that is solid hides what is behind it, even if light gets through it.
#[test]
fn translucent_props_hide_objects_behind_them() {
    let mut scene = scene_with_meshes(1.0);
    scene.set_background(SKY);
    scene.dress(SolidOpacity::At(0.3));
    for (msaa, mode) in [Msaa::Off, Msaa::Sample4].into_iter().flat_map(|msaa| MODES.map(|mode| (msaa, mode))) {
        scene.set((msaa, PropPlacement::Scene));
        let without = scene.capture();
        let pane = spawn_square(&mut scene, Vec3::new(0.2, 0.1, -1.0), 3.0, material(mode));
        let [expected, found] = both(&mut scene);
        scene.world().despawn(pane);
        assert!(differing(&expected, &without, 16) > 200, "{msaa:?}, {mode:?}: the pane does not show beside the prop");
        assert_eq!(differing(&found, &expected, 1), 0, "{msaa:?}, {mode:?}");
    }
}

/// What is bright before a prop glows around it, and what is bright behind it does not.
#[test]
fn objects_over_opaque_props_glow() {
    let mut scene = scene_with_meshes(SOLID);
    scene.set((Hdr, Bloom { intensity: 0.3, ..Bloom::NATURAL }));
    let glow = StandardMaterial {
        base_color: LinearRgba::new(20.0, 10.0, 2.0, 0.9).into(),
        unlit: true,
        alpha_mode: AlphaMode::Add,
        ..default()
    };
    // How bright the corner of the frame is, with the light before the prop or behind it.
    let [before, behind] = [1.0, -1.0].map(|z| {
        let light = spawn_square(&mut scene, Vec3::new(0.0, 0.0, z), 0.3, glow.clone());
        let corners = both(&mut scene).map(|frame| at(&frame, 2, 2)[0]);
        scene.world().despawn(light);
        corners
    });
    // The prop itself is bright, too, in the scene.
    assert!(before.iter().all(|red| *red > 18) && behind.iter().all(|red| *red < 12), "{before:?}, {behind:?}");
}

/// Bevy resolves the order of objects once a frame, before the props are shown: they are drawn behind the props, and as
/// ever beside them.
#[test]
fn independent_order_is_left_alone() {
    let mut scene = scene_with_meshes(SOLID);
    scene.set_background(SKY);
    scene.set(OrderIndependentTransparencySettings::default());
    spawn_square(&mut scene, Vec3::new(0.0, 0.0, 1.0), 3.0, material(AlphaMode::Blend));
    for _ in 0..3 {
        let [expected, found] = both(&mut scene);
        assert_eq!(at(&found, 2, 2), at(&expected, 2, 2));
        assert_ne!(at(&found, SIZE / 2, SIZE / 2), at(&found, 2, 2));
    }
}

/// Two cameras with different stages share a target, and each shows what it would show alone.
#[test]
fn cameras_of_one_target_blend_objects_by_themselves() {
    let mut scene = scene_with_meshes(SOLID);
    scene.set_background(SKY);
    let (first, target) = (scene.camera, scene.headless.target());
    let second = (exact_camera(SKY), target, Transform::from_xyz(0.0, 0.0, 3.0));
    let second = scene.world().spawn(second).id();
    let mut camera = scene.world().get_mut::<Camera>(second).unwrap();
    (camera.order, camera.msaa_writeback) = (1, MsaaWriteback::Off);
    scene.dress(Posterize { edges: EdgeSmoothing::Off, ..default() });
    spawn_square(&mut scene, Vec3::new(0.0, 0.2, 1.0), 0.8, material(AlphaMode::Multiply));
    for (camera, x) in [(first, 0), (second, SIZE / 2)] {
        let (physical_position, physical_size) = (UVec2::new(x, 4), UVec2::splat(SIZE / 2));
        let viewport = Viewport { physical_position, physical_size, ..default() };
        scene.world().get_mut::<Camera>(camera).unwrap().viewport = Some(viewport);
    }
    for msaa in [Msaa::Off, Msaa::Sample4] {
        for stages in [[PropPlacement::Scene, PropPlacement::Display], [PropPlacement::Display, PropPlacement::Scene]] {
            for (camera, stage) in [first, second].into_iter().zip(stages) {
                scene.world().entity_mut(camera).insert((msaa, stage));
            }
            let frame = scene.capture();
            for (x, y) in (0..SIZE / 2).flat_map(|x| (4..4 + SIZE / 2).map(move |y| (x, y))) {
                let [left, right] = [at(&frame, x, y), at(&frame, x + SIZE / 2, y)];
                let is_same = (0..3).all(|c| left[c].abs_diff(right[c]) <= 2);
                assert!(is_same, "{msaa:?}, {stages:?}, {x}, {y}: {left:?}, {right:?}");
            }
        }
    }
}
