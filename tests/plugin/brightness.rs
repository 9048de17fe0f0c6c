//! Tests the light that lights add to props, on a ball and on a wall, against the light of white meshes in float64.

use std::{f64::consts::PI, sync::LazyLock};

use bevy::{
    camera::{Exposure, ScalingMode, visibility::RenderLayers},
    light::{CascadeShadowConfigBuilder, GlobalAmbientLight, ShadowFilteringMethod},
    prelude::*,
};
use bevy_plenoctree::{
    BorderSmoothing, EdgeSmoothing, FieldPalette, PlenOctree, Posterize, PropLighting, PropTint, headless::exact_camera,
};
use glam::{DVec2, DVec3};
use image::RgbaImage;

use super::stage::{
    Stage,
    fields::{colored, included, included_palette},
    pixels::{color, linear, places},
};

/// The width of a frame, which shows x and y from -1 to 1.
const PIXELS: u32 = 256;
const RADIUS: f64 = 0.8;
/// The colors of props, in encoded sRGB.
const GRAY: f64 = 0.4;
/// The direction to the sun.
const TOWARD: DVec3 = DVec3::new(0.8, 0.1, 0.45);
/// The z of the front of the wall.
const WALL: f64 = 0.2;

/// A field that is solid where a distance is negative, in cells of 1/64. As in trained fields, it gets so gradually.
fn shape(distance: impl Fn(DVec3) -> f64 + Sync) -> PlenOctree {
    colored(7, |at| 400.0 * (0.5 - 32.0 * distance(at)).clamp(0.0, 1.0), |_| DVec3::splat(GRAY))
}

static BALL: LazyLock<PlenOctree> = LazyLock::new(|| shape(|at| at.length() - RADIUS));

fn wall() -> PlenOctree {
    shape(|at| (at.z - WALL).max(at.x.abs() - 0.9).max(at.y.abs() - 0.9).max(-0.2 - at.z))
}

/// Creates a scene with a prop and without lights.
fn scene(field: &PlenOctree) -> Stage {
    let mut stage = Stage::with_meshes(PIXELS);
    stage.world().insert_resource(GlobalAmbientLight::NONE);
    stage.spawn_prop(field, ());
    let scaling_mode = ScalingMode::Fixed { width: 2.0, height: 2.0 };
    stage.set((
        ShadowFilteringMethod::Hardware2x2,
        Projection::Orthographic(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() }),
        Transform::from_xyz(0.0, 0.0, 5.0),
    ));
    stage.wait();
    stage
}

fn light(stage: &mut Stage, lighting: PropLighting) -> RgbaImage {
    stage.dress(lighting);
    stage.capture()
}

/// Posterizes the prop with hard edges, in a palette of encoded colors.
fn posterize(stage: &mut Stage, colors: &[DVec3]) {
    stage.paint(FieldPalette::from_colors(colors.iter().copied().map(color)).unwrap());
    let (edges, borders) = (EdgeSmoothing::Off, BorderSmoothing::Off);
    stage.dress(Posterize { blend_steps: 1, softness: 0.0, edges, borders, ..default() });
    stage.wait();
}

fn spawn_sun(stage: &mut Stage, toward: DVec3, illuminance: f64, casts: bool) -> Entity {
    let sun = DirectionalLight { illuminance: illuminance as f32, shadow_maps_enabled: casts, ..default() };
    let place = Transform::default().looking_to(-toward.as_vec3(), Vec3::Y);
    let cascades = CascadeShadowConfigBuilder { first_cascade_far_bound: 4.0, maximum_distance: 12.0, ..default() };
    stage.spawn((sun, place, cascades.build(), RenderLayers::from_layers(&[0, 1])))
}

/// Returns the place of the center of a pixel.
fn place(x: u32, y: u32) -> DVec2 {
    let at = (DVec2::new(x.into(), y.into()) + 0.5) * (2.0 / f64::from(PIXELS)) - 1.0;
    DVec2::new(at.x, -at.y)
}

/// Returns the normal of the ball in a pixel, unless it is near its outline.
fn normal(x: u32, y: u32) -> Option<DVec3> {
    normal_within(0.9, x, y)
}

/// Returns the normal of the ball in a pixel, if its projection is shorter than `part`.
fn normal_within(part: f64, x: u32, y: u32) -> Option<DVec3> {
    let at = place(x, y) / RADIUS;
    (at.length() < part).then(|| at.extend((1.0 - at.length_squared()).sqrt()))
}

/// Returns the illuminance in which a white mesh is so bright.
fn illuminance(white: f64) -> f64 {
    white * PI / f64::from(Exposure::default().exposure())
}

/// Returns the factor by which the light of a pixel exceeds that of the prop.
fn factor(frame: &RgbaImage, x: u32, y: u32) -> f64 {
    f64::from(linear(frame.get_pixel(x, y)).y / color(DVec3::splat(GRAY)).to_linear().green)
}

/// As trained, the light of a ball follows the angle at which the sun's light falls on it.
#[test]
fn what_faces_the_sun_gets_brighter() {
    let mut scene = scene(&BALL);
    let unlit = scene.capture();
    let lighting = PropLighting { shadows: 0.5, ..default() };
    let sun = spawn_sun(&mut scene, TOWARD, illuminance(2.0), false);
    assert_eq!(light(&mut scene, lighting), unlit, "no brightness");
    assert!(!scene.has_pipeline("BRIGHTNESS"));
    let lit = light(&mut scene, PropLighting { brightness: 1.5, ..lighting });
    assert!(scene.has_pipeline("BRIGHTNESS"));
    let (mut count, mut sum, mut most) = (0, 0.0, 0.0f64);
    for (x, y) in places(PIXELS, PIXELS) {
        let Some(normal) = normal(x, y) else { continue };
        let cosine = normal.dot(TOWARD.normalize());
        if cosine < -0.15 {
            assert_eq!(lit.get_pixel(x, y), unlit.get_pixel(x, y), "({x}, {y}) faces away");
        }
        let expected = 1.0 + 1.5 * (1.0 - (-2.0 * cosine.max(0.0)).exp());
        let error = (factor(&lit, x, y) - expected).abs();
        count += 1;
        sum += error;
        most = most.max(error);
    }
    let mean = sum / f64::from(count);
    assert!(mean < 0.02 && most < 0.1, "the error of the factor is {mean:.3} on average and at most {most:.3}");
    // Nothing else brightens it.
    scene.world().despawn(sun);
    assert_eq!(light(&mut scene, PropLighting { brightness: 1.5, ..lighting }), unlit, "no light");
    let brightness = (illuminance(0.5) / PI / 0.45) as f32;
    scene.world().insert_resource(GlobalAmbientLight { brightness, ..default() });
    let ambient = scene.capture();
    let expected = 1.0 + 1.5 * (1.0 - (-0.5f64).exp());
    for (x, y) in places(PIXELS, PIXELS).filter(|(x, y)| normal(*x, *y).is_some()) {
        assert!((factor(&ambient, x, y) - expected).abs() < 0.03, "ambient light at ({x}, {y})");
    }
}

/// Posterized, lit parts go up the palette, and end at a smooth line where the light of the sun is half as strong as it
/// can get.
#[test]
fn bands_of_a_ball_end_where_the_light_says() {
    let (gray, bright) = (DVec3::splat(GRAY), DVec3::splat(0.52));
    let mut scene = scene(&BALL);
    // The third color is nearer to twice the light, but has another hue.
    posterize(&mut scene, &[gray, bright, DVec3::new(0.6, 0.5, 0.5)]);
    spawn_sun(&mut scene, TOWARD, illuminance(2.0), false);
    let unlit = scene.capture();
    for bands in [1, 2] {
        let lit = light(&mut scene, PropLighting { brightness: 1.0, bands, ..default() });
        let is_lit = |x: u32, y: u32| f64::from(lit.get_pixel(x, y)[1]) > 255.0 * 0.46;
        // Where light of this strength falls on it, the first band begins.
        let first = -(1.0 - 0.5 / f64::from(bands)).ln() / 2.0;
        let mut most = 0.0f64;
        for (x, y) in places(PIXELS, PIXELS) {
            let Some(normal) = normal(x, y) else { continue };
            let angle = normal.dot(TOWARD.normalize()).acos().to_degrees() - first.acos().to_degrees();
            let shown = lit.get_pixel(x, y);
            if angle.abs() > 6.0 {
                let band = if angle < 0.0 { bright.x } else { GRAY };
                if bands == 1 {
                    assert!((f64::from(shown[1]) - 255.0 * band).abs() < 2.0, "{shown:?} at ({x}, {y}), {angle}");
                }
                if angle > 0.0 {
                    assert_eq!(shown, unlit.get_pixel(x, y), "({x}, {y}) faces away");
                }
            }
            if is_lit(x, y) != (angle < 0.0) {
                most = most.max(angle.abs());
            }
        }
        for (x, y) in places(PIXELS, PIXELS) {
            if normal_within(0.98, x, y).is_some_and(|normal| normal.dot(TOWARD.normalize()) < -0.2) {
                assert_eq!(lit.get_pixel(x, y), unlit.get_pixel(x, y), "({x}, {y}) is on the dark side");
            }
        }
        assert!(most < 2.0, "the line of {bands} bands is off by {most:.2} degrees");
        // In a row of pixels, the light ends once.
        let row = |y: u32| (0..PIXELS).filter(|x| normal(*x, y).is_some()).map(|x| is_lit(x, y)).collect::<Vec<_>>();
        let ragged = (0..PIXELS).filter(|y| row(*y).windows(2).filter(|pair| pair[0] != pair[1]).count() > 1).count();
        assert_eq!(ragged, 0, "rows in which the light of {bands} bands ends more than once");
    }

    // Beyond the end of the ramp, the color itself gets lighter.
    posterize(&mut scene, &[gray, DVec3::new(0.6, 0.5, 0.5)]);
    let lit = light(&mut scene, PropLighting { brightness: 1.0, ..default() });
    let (x, y) =
        places(PIXELS, PIXELS).find(|(x, y)| normal(*x, *y).is_some_and(|normal| normal.dot(TOWARD) > 0.9)).unwrap();
    assert!((factor(&lit, x, y) - 2.0).abs() < 0.05, "{:?}", lit.get_pixel(x, y));
}

/// The surface of a hard field consists of steps, a few pixels wide. Bands end at a smooth line all the same.
#[test]
fn bands_do_not_show_the_steps_of_hard_surfaces() {
    let hard = |at: DVec3| if at.length() < RADIUS { 1e4 } else { 0.0 };
    let mut scene = scene(&colored(6, hard, |_| DVec3::splat(GRAY)));
    posterize(&mut scene, &[DVec3::splat(GRAY), DVec3::splat(0.52)]);
    spawn_sun(&mut scene, TOWARD, illuminance(2.0), false);
    let lit = light(&mut scene, PropLighting { brightness: 1.0, bands: 1, ..default() });
    let is_lit = |x: u32, y: u32| f64::from(lit.get_pixel(x, y)[1]) > 255.0 * 0.46;
    let end = (0.5f64.ln() / -2.0).acos().to_degrees();
    let mut most = 0.0f64;
    for y in 0..PIXELS {
        let row: Vec<_> = (0..PIXELS).filter_map(|x| Some((x, normal(x, y)?))).collect();
        for &(x, normal) in &row {
            let angle = normal.dot(TOWARD.normalize()).acos().to_degrees() - end;
            most = most.max(if is_lit(x, y) == (angle < 0.0) { 0.0 } else { angle.abs() });
        }
        let ends = row.windows(2).filter(|pair| is_lit(pair[0].0, y) != is_lit(pair[1].0, y)).count();
        assert!(ends <= 1, "in row {y}, the light ends {ends} times");
    }
    assert!(most < 3.5, "the line is off by {most:.2} degrees");
}

/// Lamps reach as far as their range says, several lights add up, and what is in a shadow gets none of them.
#[test]
fn lights_add_up_within_their_range() {
    let mut scene = scene(&wall());
    let unlit = scene.capture();
    let lighting = PropLighting { shadows: 0.5, brightness: 1.0, ..default() };
    // How bright a lamp makes a white mesh, before it is brought to what is added.
    let seen = |frame: &RgbaImage, x, y| -(2.0 - factor(frame, x, y)).max(1e-3).ln();
    let lamps = [DVec3::new(-0.2, 0.1, 0.6), DVec3::new(0.3, 0.0, 0.5)];
    let lamp = |at: DVec3, range: f32| {
        let intensity = (4.0 * PI * illuminance(0.06)) as f32;
        (PointLight { intensity, range, radius: 0.0, ..default() }, Transform::from_translation(at.as_vec3()))
    };
    let expected = |at: DVec3, range: f64, x, y| {
        let to = at - place(x, y).extend(WALL);
        let fade = (1.0 - (to.length() / range).powi(4)).max(0.0);
        0.06 * fade * fade * to.z / to.length().powi(3)
    };
    let frames = lamps.map(|at| {
        let spawned = scene.spawn(lamp(at, 0.7));
        let frame = light(&mut scene, lighting);
        scene.world().despawn(spawned);
        frame
    });
    let both = lamps.map(|at| scene.spawn(lamp(at, 0.7)));
    let sum = scene.capture();
    let (mut far, mut near) = (0, 0);
    for (x, y) in places(PIXELS, PIXELS).filter(|(x, y)| place(*x, *y).abs().max_element() < 0.8) {
        let from = lamps.map(|at| at.distance(place(x, y).extend(WALL)));
        for ((at, frame), distance) in lamps.into_iter().zip(&frames).zip(from) {
            if distance > 0.8 {
                far += 1;
                assert_eq!(frame.get_pixel(x, y), unlit.get_pixel(x, y), "({x}, {y}) is out of the range");
            }
            let (found, expected) = (seen(frame, x, y), expected(at, 0.7, x, y));
            assert!((found - expected).abs() < 0.05 + 0.08 * expected, "{found}, expected {expected} at ({x}, {y})");
        }
        let [a, b] = frames.each_ref().map(|frame| seen(frame, x, y));
        near += u32::from(a > 0.1 && b > 0.1);
        assert!((seen(&sum, x, y) - a - b).abs() < 0.03 + 0.05 * (a + b), "({x}, {y}) in both");
    }
    assert!(far > 1000 && near > 500, "{far} far and {near} near pixels");

    // A prop that the camera does not see, before the sun.
    both.into_iter().for_each(|lamp| _ = scene.world().despawn(lamp));
    let sun = spawn_sun(&mut scene, DVec3::Z, illuminance(1.0), true);
    let above = Transform::from_xyz(0.0, 0.0, 2.0).with_scale(Vec3::splat(0.6));
    scene.spawn_prop(&shape(|at| at.abs().max_element() - 0.5), (above, RenderLayers::layer(1)));
    scene.wait();
    let shadowed = scene.capture();
    for (x, y) in places(PIXELS, PIXELS) {
        let off = place(x, y).abs().max_element();
        if off < 0.25 {
            assert!((factor(&shadowed, x, y) - 0.5).abs() < 0.03, "({x}, {y}) is in the shadow");
        } else if (0.36..0.8).contains(&off) {
            let expected = 2.0 - (-1.0f64).exp();
            assert!((factor(&shadowed, x, y) - expected).abs() < 0.03, "({x}, {y}) is in the sun");
        }
    }

    // Where it is blocked, a lamp that adds light takes none away.
    scene.world().despawn(sun);
    let lamp = PointLight { shadow_maps_enabled: true, range: 20.0, radius: 0.0, ..default() };
    scene.spawn((lamp, Transform::from_xyz(0.0, 0.0, 4.0), RenderLayers::from_layers(&[0, 1])));
    let adds = light(&mut scene, lighting);
    let darkens = light(&mut scene, PropLighting { brightness: 0.0, ..lighting });
    for (x, y) in places(PIXELS, PIXELS).filter(|(x, y)| place(*x, *y).abs().max_element() < 0.3) {
        assert_eq!(adds.get_pixel(x, y), unlit.get_pixel(x, y), "({x}, {y}) is behind the other prop");
        assert!((factor(&darkens, x, y) - 0.5).abs() < 0.03, "({x}, {y}) is in its shadow");
    }

    // The shadow of a moon is lost in the light of a lamp that passes by.
    let lamp = PointLight { intensity: (PI * illuminance(8.0)) as f32, range: 20.0, radius: 0.0, ..default() };
    scene.spawn((lamp, Transform::from_xyz(0.0, 0.0, 1.0)));
    let without = light(&mut scene, lighting);
    spawn_sun(&mut scene, DVec3::Z, illuminance(0.01), true);
    let with = scene.capture();
    for (x, y) in places(PIXELS, PIXELS).filter(|(x, y)| place(*x, *y).abs().max_element() < 0.25) {
        let [found, expected] = [&with, &without].map(|frame| factor(frame, x, y));
        assert!(expected > 1.5 && (found - expected).abs() < 0.06, "{found}, expected {expected} at ({x}, {y})");
    }
}

/// A light from behind a ball lights its outline if there is a rim, and nothing else.
#[test]
fn rims_light_outlines() {
    let mut scene = scene(&BALL);
    let unlit = scene.capture();
    spawn_sun(&mut scene, DVec3::new(1.0, 0.0, -1.0), illuminance(4.0), false);
    let lighting = PropLighting { brightness: 1.0, ..default() };
    let plain = light(&mut scene, lighting);
    let rim = light(&mut scene, PropLighting { rim: 1.0, ..lighting });
    let middle = PIXELS / 2;
    let edge = (middle + (RADIUS * f64::from(middle)) as u32) - 3;
    assert!(factor(&rim, edge, middle) > 1.5, "{}", factor(&rim, edge, middle));
    for (x, y) in places(PIXELS, PIXELS).filter(|(x, y)| place(*x, *y).length() < 0.6) {
        assert_eq!(rim.get_pixel(x, y), plain.get_pixel(x, y), "({x}, {y}) is away from the outline");
    }
    for (x, y) in places(PIXELS, PIXELS).filter(|(x, _)| *x < middle - 8) {
        assert_eq!(rim.get_pixel(x, y), unlit.get_pixel(x, y), "({x}, {y}) is on the other side");
    }
}

/// In the light of a cartoon, the knobs of the robot cast no shadows on its front: only their ends would be seen, as
/// spots.
#[test]
fn cartoons_have_no_ends_of_shadows() {
    const WIDTH: u32 = 480;
    let mut stage = Stage::with_meshes(WIDTH);
    stage.spawn_prop(&included("robot"), ());
    stage.paint(included_palette("robot"));
    stage.set((exact_camera(Color::WHITE), Transform::from_xyz(0.0, 0.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    spawn_sun(&mut stage, DVec3::new(3.0, 5.0, 2.0), 8000.0, true);
    let toon = PropLighting::toon(2.0);
    stage.dress((Posterize::toon(), toon));
    stage.wait();
    let spots = |stage: &mut Stage, self_shadow_distance: f32| {
        let with = light(stage, PropLighting { self_shadow_distance, ..toon });
        let without = light(stage, PropLighting { self_shadow_distance: f32::MAX, ..toon });
        let front = places(WIDTH, WIDTH).filter(|(x, y)| (165..310).contains(x) && (215..310).contains(y));
        front.filter(|(x, y)| linear(with.get_pixel(*x, *y)).y < 0.9 * linear(without.get_pixel(*x, *y)).y).count()
    };
    let [ours, shorter] = [1.0, 0.67].map(|part| spots(&mut stage, part * toon.self_shadow_distance));
    assert!(
        shorter > 500 && ours < shorter / 10,
        "{ours} pixels are dark, and {shorter} at two thirds of the distance"
    );
}

/// What the guide says of nights: in the light of a lamp, dark props look as trained, posterized ones, too.
#[test]
fn lamps_bring_back_what_night_takes() {
    let night = PropTint(Color::linear_rgb(0.25, 0.25, 0.3));
    let mut scene = scene(&BALL);
    scene.headless.resize(UVec2::splat(PIXELS / 2));
    for name in ["robot", "chest", "drum"] {
        scene.show(&included(name));
        scene.paint(included_palette(name));
        scene.dress(Posterize::toon());
        scene.wait();
        let mean = |scene: &mut Stage| scene.capture().pixels().map(linear).sum::<Vec3>().element_sum();
        let by_day = mean(&mut scene);
        scene.dress((night, PropLighting { brightness: 3.0, ..default() }));
        let dark = mean(&mut scene) / by_day;
        let lamp = PointLight { intensity: 3e7, range: 30.0, ..default() };
        let lamp = scene.spawn((lamp, Transform::from_xyz(0.3, 0.5, 5.0)));
        let lit = mean(&mut scene) / by_day;
        scene.undress::<(Posterize, PropTint, PropLighting)>();
        scene.world().despawn(lamp);
        println!("{name}: {dark:.2} of the light of day, and {lit:.2} next to a lamp");
        assert!(dark < 0.3 && (0.8..1.2).contains(&lit), "{name}: {dark}, {lit}");
    }
}
