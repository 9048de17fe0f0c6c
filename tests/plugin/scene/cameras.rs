//! Tests cameras of every kind, and what they must not show.

use std::{
    f32::consts::FRAC_PI_2,
    sync::{Arc, Mutex},
};

use bevy::{
    camera::{Hdr, RenderTarget, visibility::RenderLayers},
    prelude::*,
    render::{
        render_resource::TextureFormat,
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
};
use bevy_plenoctree::headless::exact_camera;
use glam::DVec2;

use crate::stage::sides::{
    BACKGROUND, BLUE, GREEN, PIXELS, RED, SOLID, Side, Sides, color, cube, density, flat, in_cube, seen, shape,
};

/// Returns a projection with a field of view of 90 degrees. The ray of the pixel at (x, y) goes along
/// (x / 2, y / 2, -1).
fn wide() -> Projection {
    Projection::Perspective(PerspectiveProjection { fov: FRAC_PI_2, aspect_ratio: 1.0, ..default() })
}

/// The distance of that camera's near plane.
const NEAR: f64 = 0.1;

/// Replaces the projection and transform of the front camera.
fn place_camera(stage: &mut Sides, projection: Projection, transform: Transform) {
    stage.set((projection, transform));
}

#[test]
fn props_alone() {
    Sides::new().run(&[
        a_camera_inside_fog_sees_what_is_in_front_of_it,
        rays_start_at_a_near_plane_behind_the_camera,
        a_mirrored_camera_sees_everything_mirrored,
        cameras_draw_to_targets_of_every_format_at_once,
        invisible_props_change_nothing,
        a_camera_sees_the_props_on_its_layers,
    ]);
}

/// The camera is at the center of a cube of fog, whose far side is at distance 1. All rays of a perspective camera
/// begin at the near plane, and leave through that side.
fn a_camera_inside_fog_sees_what_is_in_front_of_it(stage: &mut Sides) {
    stage.spawn_prop(&shape(0.5, GREEN, |_| true), ());
    stage.wait();
    place_camera(stage, wide(), default());
    stage.check("perspective", |side, place| {
        let opacity = 1.0 - (-0.5 * (1.0 - NEAR) * (0.5 * place).extend(1.0).length()).exp();
        (side == Side::Front).then_some(BACKGROUND.lerp(GREEN, opacity))
    });
    place_camera(stage, flat(), default());
    stage.check("orthographic", |side, place| {
        let opacity = if place.abs().max_element() < 1.0 { 1.0 - (-0.5f64).exp() } else { 0.0 };
        (side == Side::Front).then_some(BACKGROUND.lerp(GREEN, opacity))
    });
}

/// What is nearer than the near plane is not drawn, whatever the projection, as of meshes: a cube of fog and a mesh in
/// it, then the fog alone, then nothing.
#[test]
fn near_planes_cut_props_like_meshes() {
    let mut stage = Sides::with_meshes();
    stage.spawn_prop(&shape(0.5, GREEN, |_| true), ());
    stage.spawn_rectangle((-2.0, -2.0), (2.0, 2.0), 0.25, RED, 1.0);
    stage.wait();
    let Projection::Orthographic(orthographic) = flat() else { panic!() };
    for near in [1.0, 2.5, 3.25, 3.5, 4.5] {
        let perspective = PerspectiveProjection { fov: FRAC_PI_2, aspect_ratio: 1.0, near, ..default() };
        // The cube is at distances from 2 to 4, and the mesh at 2.75.
        let far = if near < 2.75 { 2.75 } else { 4.0 };
        let path = (far - f64::from(near).max(2.0)).max(0.0);
        let behind = if near < 2.75 { RED } else { BACKGROUND };
        let middle = |place: DVec2| place.abs().max_element() < 0.4;
        let at = Transform::from_xyz(0.0, 0.0, 3.0);
        place_camera(&mut stage, Projection::Perspective(perspective), at);
        stage.check(format!("perspective, near plane at {near}"), |side, place| {
            let slant = (0.5 * place).extend(1.0).length();
            let opacity = 1.0 - (-0.5 * path * slant).exp();
            (side == Side::Front && middle(place)).then_some(behind.lerp(GREEN, opacity))
        });
        let orthographic = OrthographicProjection { near, ..orthographic.clone() };
        place_camera(&mut stage, Projection::Orthographic(orthographic), at);
        stage.check(format!("orthographic, near plane at {near}"), |side, place| {
            (side == Side::Front && middle(place)).then_some(behind.lerp(GREEN, 1.0 - (-0.5 * path).exp()))
        });
    }
}

/// If its near plane is behind it, an orthographic camera sees what is behind it, meshes and props alike.
fn rays_start_at_a_near_plane_behind_the_camera(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.4), GREEN), ());
    stage.wait();
    let Projection::Orthographic(projection) = flat() else { panic!() };
    place_camera(stage, Projection::Orthographic(OrthographicProjection { near: -10.0, ..projection }), default());
    stage.check("behind", |side, place| {
        seen(side, &in_cube(place).then_some((0.0, GREEN, 0.4)).into_iter().collect::<Vec<_>>())
    });
}

/// A mirrored camera, such as one that draws a reflection, swaps left and right.
fn a_mirrored_camera_sees_everything_mirrored(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.4), GREEN), Transform::from_xyz(0.25, 0.0, 0.0));
    stage.wait();
    let mirrored = Transform::from_xyz(0.0, 0.0, 5.0).with_scale(Vec3::new(-1.0, 1.0, 1.0));
    place_camera(stage, flat(), mirrored);
    stage.camera_mut().invert_culling = true;
    stage.check("mirrored", |side, place| {
        // The front camera's pixels are mirrored.
        let x = if side == Side::Front { -place.x } else { place.x };
        let covers = in_cube(DVec2::new(x - 0.25, place.y));
        seen(side, &covers.then_some((0.0, GREEN, 0.4)).into_iter().collect::<Vec<_>>())
    });
}

/// Captures an image that cameras draw to.
fn capture(stage: &mut Sides, image: &Handle<Image>) -> Image {
    let captured = Arc::new(Mutex::new(None));
    let result = captured.clone();
    stage.world().spawn(Screenshot::image(image.clone())).observe(move |event: On<ScreenshotCaptured>| {
        *result.lock().unwrap() = Some(event.image.clone());
    });
    for _ in 0..1000 {
        stage.update(1);
        if let Some(image) = captured.lock().unwrap().take() {
            return image;
        }
    }
    panic!("no frame was captured");
}

/// Each target has its own format and camera, half a unit farther to the right than the previous one.
fn cameras_draw_to_targets_of_every_format_at_once(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.4), GREEN), ());
    stage.spawn_prop(&cube(SOLID, BLUE), Transform::from_xyz(0.0, 0.75, -1.0));
    let targets = [
        (TextureFormat::Rgba16Float, true, Msaa::Sample4),
        (TextureFormat::Rgba16Float, false, Msaa::Off),
        (TextureFormat::Bgra8UnormSrgb, false, Msaa::Sample4),
        (TextureFormat::Bgra8UnormSrgb, true, Msaa::Off),
        (TextureFormat::Rgba8Unorm, false, Msaa::Off),
    ];
    let mut images = Vec::new();
    for (index, (format, hdr, msaa)) in targets.into_iter().enumerate() {
        let image: Handle<Image> = stage.add(Image::new_target_texture(PIXELS, PIXELS, format, None));
        let target = RenderTarget::Image(image.clone().into());
        let transform = Transform::from_xyz(0.5 * index as f32, 0.0, 5.0);
        let camera = stage.spawn((exact_camera(color(BACKGROUND)), target, flat(), transform));
        stage.insert(camera, msaa);
        if hdr {
            stage.insert(camera, Hdr);
        }
        images.push(image);
    }
    stage.wait();
    let expected = |side, place: DVec2| {
        let mut layers = Vec::new();
        layers.extend(in_cube(place).then_some((0.0, GREEN, 0.4)));
        layers.extend(in_cube(place - DVec2::new(0.0, 0.75)).then_some((-1.0, BLUE, 1.0)));
        seen(side, &layers)
    };
    for (index, (image, target)) in images.iter().zip(targets).enumerate() {
        let captured = capture(stage, image);
        for (x, y) in (0..PIXELS).flat_map(|y| (0..PIXELS).map(move |x| (x, y))) {
            let place = (DVec2::new(x.into(), y.into()) + 0.5) / 8.0 - 2.0;
            let expected = expected(Side::Front, DVec2::new(place.x + 0.5 * index as f64, -place.y));
            // Compare in the target's own encoding, to within 2/255.
            let pixel = captured.get_color_at(x, y).unwrap();
            let off = if target.0.is_srgb() {
                pixel.to_srgba().to_vec3() - expected.as_vec3()
            } else {
                pixel.to_linear().to_vec3() - color(expected).to_linear().to_vec3()
            };
            assert!(off.abs().max_element() <= 2.0 / 255.0, "{target:?}: {pixel:?} at {x}, {y}, expected {expected}");
        }
    }
    stage.check("the stage", expected);
}

/// A prop that no camera sees does not change a single byte of the frame.
fn invisible_props_change_nothing(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.4), GREEN), ());
    stage.wait();
    let alone = stage.capture();
    let other = stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.25, 0.25, 0.75));
    stage.wait();
    assert!(stage.capture() != alone, "visible");
    let mut insert_and_check = |what, change: fn(&mut EntityWorldMut)| {
        change(&mut stage.world().entity_mut(other));
        assert!(stage.capture() == alone, "{what}");
    };
    insert_and_check("on another layer", |prop| {
        prop.insert(RenderLayers::layer(1));
    });
    insert_and_check("hidden", |prop| {
        prop.insert((RenderLayers::layer(0), Visibility::Hidden));
    });
    insert_and_check("outside the view", |prop| {
        prop.insert((Visibility::Inherited, Transform::from_xyz(3.0, 0.0, 0.0)));
    });
    insert_and_check("flattened to nothing", |prop| {
        prop.insert(Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    });
}

fn a_camera_sees_the_props_on_its_layers(stage: &mut Sides) {
    let red = stage.spawn_prop(&cube(density(0.4), RED), Transform::from_xyz(-0.25, 0.0, 0.0));
    let blue = stage.spawn_prop(&cube(SOLID, BLUE), Transform::from_xyz(0.25, 0.0, 0.0));
    let [_, behind] = stage.cameras;
    stage.insert(red, RenderLayers::from_layers(&[0, 1]));
    stage.insert(blue, RenderLayers::layer(1));
    stage.insert(behind, RenderLayers::layer(1));
    stage.wait();
    // The props overlap in the view, but each side sees only the props on its layers.
    stage.world().get_mut::<Transform>(blue).unwrap().translation = Vec3::new(0.5, 0.0, -1.0);
    stage.check("layers", |side, place| {
        let mut layers = Vec::new();
        layers.extend(in_cube(place + DVec2::new(0.25, 0.0)).then_some((0.0, RED, 0.4)));
        let blue = side == Side::Behind && in_cube(place - DVec2::new(0.5, 0.0));
        layers.extend(blue.then_some((-1.0, BLUE, 1.0)));
        seen(side, &layers)
    });
}
