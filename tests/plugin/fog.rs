//! Tests fog: a prop and a mesh of the same color and at the same depth, side by side, fade alike.

use bevy::{core_pipeline::tonemapping::Tonemapping, prelude::*};
use bevy_plenoctree::{EdgeSmoothing, FieldPalette, Posterize, Prop, PropPlacement, PropQuality, SolidOpacity};
use glam::DVec3;
use image::RgbaImage;

use crate::stage::{
    Stage, TONEMAPPINGS,
    pixels::{differing, encoded, steps},
    sides::{BACKGROUND, GREEN, PIXELS, SOLID, Sides, color, cube, density, in_cube},
    unlit,
};

/// The x of the centers of the mesh and of the prop, mirrored.
const ASIDE: f32 = 0.875;

/// Spawns a prop on the left and a mesh on the right, cubes of the same size and color, and a sun. Returns the prop and
/// the sun.
fn spawn_pair(stage: &mut Sides, encoded: DVec3) -> (Entity, Entity) {
    let prop = stage.spawn_prop(&cube(SOLID, encoded), Transform::from_xyz(-ASIDE, 0.0, 0.0));
    let cuboid = Cuboid::new(1.0, 1.0, 1.0);
    stage.spawn_mesh(cuboid, unlit(color(encoded)), Transform::from_xyz(ASIDE, 0.0, 0.0));
    let toward = Vec3::new(0.0, 0.2, -1.0);
    let sun = DirectionalLight { illuminance: 800.0, ..default() };
    let sun = stage.spawn((sun, Transform::default().looking_to(-toward, Vec3::Y)));
    stage.paint(FieldPalette::from_colors([color(GREEN), color(BACKGROUND)]).unwrap());
    stage.wait();
    (prop, sun)
}

/// Returns the pixels of the front camera that are well within one cube, and those that mirror them.
fn pairs() -> impl Iterator<Item = ([u32; 2], [u32; 2])> {
    // The cubes cover pixels 5 to 12 and 19 to 26 along x, and 12 to 19 along y.
    (14..18).flat_map(|y| (7..11).map(move |x| ([x, y], [PIXELS - 1 - x, y])))
}

fn at(frame: &RgbaImage, [x, y]: [u32; 2]) -> DVec3 {
    steps(frame.get_pixel(x, y))
}

/// Expects that the prop looks like the mesh, and unlike without fog.
#[track_caller]
fn check(stage: &mut Sides, clear: DVec3, what: &str) {
    let frame = stage.capture();
    for (of_prop, of_mesh) in pairs() {
        let (prop, mesh) = (at(&frame, of_prop), at(&frame, of_mesh));
        assert!((prop - mesh).abs().max_element() <= 2.0, "{what}: {prop} at {of_prop:?}, mesh {mesh}");
        assert!((mesh - 255.0 * clear).abs().max_element() > 20.0, "{what}: no fog: {mesh}");
    }
}

/// Fog of every falloff, without and with the color of the sun.
fn fogs() -> Vec<(String, DistanceFog)> {
    let falloffs = [
        ("linear", FogFalloff::Linear { start: 2.0, end: 8.0 }),
        ("exponential", FogFalloff::Exponential { density: 0.15 }),
        ("squared", FogFalloff::ExponentialSquared { density: 0.15 }),
        (
            "atmospheric",
            FogFalloff::Atmospheric { extinction: Vec3::new(0.1, 0.2, 0.3), inscattering: Vec3::new(0.3, 0.2, 0.1) },
        ),
    ];
    let of = |(name, falloff): (&str, FogFalloff)| {
        let fog = DistanceFog { color: Color::srgba(0.9, 0.5, 0.7, 0.9), falloff, ..default() };
        let glow = Color::srgba(1.0, 0.9, 0.3, 0.6);
        let glowing = DistanceFog { directional_light_color: glow, directional_light_exponent: 6.0, ..fog.clone() };
        [(name.to_string(), fog), (format!("{name}, with the sun"), glowing)]
    };
    falloffs.into_iter().flat_map(of).collect()
}

#[test]
fn props_in_fog() {
    Sides::with_meshes().run(&[
        props_fade_as_meshes_do,
        props_fade_as_meshes_do_whose_tones_are_mapped,
        thick_fog_hides_props_whose_tones_are_mapped,
        thin_fog_keeps_colors_whose_tones_are_mapped,
        fog_covers_as_much_as_the_prop_does,
        fog_ends_with_the_scene,
    ]);
}

fn props_fade_as_meshes_do(stage: &mut Sides) {
    let (prop, sun) = spawn_pair(stage, GREEN);
    let clear = stage.capture();
    assert!(!stage.has_pipeline("plenoctree_fog"));
    for (name, fog) in fogs() {
        stage.set_both(fog.clone());
        check(stage, GREEN, &format!("{name}, as trained"));
        stage.insert(prop, SolidOpacity::Never);
        check(stage, GREEN, &format!("{name}, never solid"));
        stage.insert(prop, SolidOpacity::default());
        for edges in [EdgeSmoothing::Off, EdgeSmoothing::Coverage] {
            stage.insert(prop, Posterize { edges, ..default() });
            check(stage, GREEN, &format!("{name}, posterized, {edges:?}"));
        }
        stage.world().entity_mut(prop).remove::<Posterize>();
    }
    assert!(stage.has_pipeline("plenoctree_fog"));
    // Shadows block what the sun scatters. The cubes are in their own.
    stage.world().get_mut::<DirectionalLight>(sun).unwrap().shadow_maps_enabled = true;
    check(stage, GREEN, "shadows");
    stage.set_both(PropQuality { ray_tolerance: 0.02, ..PropQuality::EXACT });
    check(stage, GREEN, "a grid of rays");
    stage.unset_both::<(DistanceFog, PropQuality)>();
    assert!(stage.capture() == clear, "without fog");
}

/// Without `Hdr`, materials map tones after fog. A prop in the color that a mesh shows fades as the mesh does, if it is
/// a color that tonemapping does not clip.
fn props_fade_as_meshes_do_whose_tones_are_mapped(stage: &mut Sides) {
    spawn_pair(stage, DVec3::new(0.45, 0.7, 0.35));
    for (index, tonemapping) in TONEMAPPINGS.into_iter().enumerate() {
        stage.set_both(tonemapping);
        stage.unset_both::<DistanceFog>();
        let clear = stage.capture();
        let (_, of_mesh) = pairs().next().unwrap();
        let shown = at(&clear, of_mesh) / 255.0;
        stage.show(&cube(SOLID, shown));
        // One falloff after another, because tones are mapped after any of them alike.
        for (name, fog) in &fogs()[2 * (index % 4)..][..2] {
            stage.set_both(fog.clone());
            check(stage, shown, &format!("{name}, {tonemapping:?}"));
        }
    }
}

/// Where fog hides everything, props have its color as meshes show it, even in colors that tonemapping never shows.
fn thick_fog_hides_props_whose_tones_are_mapped(stage: &mut Sides) {
    spawn_pair(stage, DVec3::new(0.0, 1.0, 0.0));
    let falloff = FogFalloff::Linear { start: 0.5, end: 1.0 };
    for (encoded, tonemapping) in [
        (DVec3::new(0.0, 1.0, 0.0), Tonemapping::TonyMcMapface),
        (DVec3::ONE, Tonemapping::KhronosPbrNeutral),
        (DVec3::ZERO, Tonemapping::ReinhardLuminance),
    ] {
        stage.show(&cube(SOLID, encoded));
        for fog in [Color::srgb(0.9, 0.5, 0.7), Color::linear_rgb(4.0, 9.0, 2.0)] {
            stage.set_both((tonemapping, DistanceFog { color: fog, falloff: falloff.clone(), ..default() }));
            check(stage, DVec3::ZERO, &format!("{fog:?}, {tonemapping:?}"));
        }
    }
}

/// Fog that hides nothing changes nothing, not even haze that is darker than black.
fn thin_fog_keeps_colors_whose_tones_are_mapped(stage: &mut Sides) {
    stage.set_both(Tonemapping::TonyMcMapface);
    for (opacity, encoded) in [(0.4, DVec3::ZERO), (0.4, GREEN), (0.9, DVec3::ONE)] {
        stage.clear();
        stage.spawn_prop(&cube(density(opacity), encoded), ());
        stage.wait();
        stage.unset_both::<DistanceFog>();
        let clear = stage.capture();
        let none = FogFalloff::Linear { start: 100.0, end: 200.0 };
        stage.set_both(DistanceFog { color: Color::WHITE, falloff: none, ..default() });
        assert_eq!(differing(&stage.capture(), &clear, 1), 0, "{opacity}, {encoded}");
    }
}

/// The fog in front of haze has the color of fog, and what shows through it has its own fog already.
fn fog_covers_as_much_as_the_prop_does(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.4), GREEN), ());
    stage.wait();
    let thick = DistanceFog {
        color: Color::linear_rgb(0.25, 0.5, 0.75),
        falloff: FogFalloff::Linear { start: 0.5, end: 1.0 },
        ..default()
    };
    stage.set_both(thick);
    let background = color(BACKGROUND).to_linear();
    let mixed = LinearRgba::rgb(
        0.6 * background.red + 0.4 * 0.25,
        0.6 * background.green + 0.4 * 0.5,
        0.6 * background.blue + 0.4 * 0.75,
    );
    let mixed = encoded(mixed);
    stage.check("haze", |_, place| Some(if in_cube(place) { mixed } else { BACKGROUND }));
}

/// A prop that is drawn after tonemapping is in no fog.
fn fog_ends_with_the_scene(stage: &mut Sides) {
    spawn_pair(stage, GREEN);
    stage.set_both(PropPlacement::Display);
    stage.wait();
    let clear = stage.capture();
    let (_, fog) = fogs().remove(0);
    stage.set_both(fog.clone());
    let frame = stage.capture();
    for (of_prop, of_mesh) in pairs() {
        assert_eq!(at(&frame, of_prop), at(&clear, of_prop));
        assert!(at(&frame, of_mesh) != at(&clear, of_mesh));
    }
}

/// The edge between a near prop and a far one of the same label fades from the fog of one to that of the other, as
/// edges of meshes do.
#[test]
fn edges_between_props_are_smooth_in_fog() {
    let mut stage = Stage::with_meshes(96);
    stage.set((Transform::from_xyz(0.0, 0.0, 2.5), Msaa::Sample4));
    let places = [
        Transform::from_rotation(Quat::from_euler(EulerRot::XYZ, 0.3, 0.5, 0.2)),
        Transform::from_xyz(0.0, 0.0, -14.0).with_scale(Vec3::splat(16.0)),
    ];
    let near = stage.spawn_prop(&cube(SOLID, GREEN), (places[0], Posterize::default()));
    let field = stage.field();
    let far = stage.spawn((Prop(field), places[1], Posterize::default()));
    stage.paint(FieldPalette::from_colors([color(GREEN), color(BACKGROUND)]).unwrap());
    let meshes = places.map(|place| stage.spawn_mesh(Cuboid::new(1.0, 1.0, 1.0), unlit(color(GREEN)), place));
    stage.wait();
    let mut off = || {
        let [of_props, of_meshes] = [true, false].map(|shows_props| {
            for (entities, shows) in [([near, far], shows_props), (meshes, !shows_props)] {
                let visibility = if shows { Visibility::Visible } else { Visibility::Hidden };
                entities.into_iter().for_each(|entity| stage.insert(entity, visibility));
            }
            stage.capture()
        });
        let fog = DistanceFog { falloff: FogFalloff::Exponential { density: 0.15 }, ..default() };
        stage.set(fog);
        let pairs = of_props.pixels().zip(of_meshes.pixels());
        pairs.filter(|(prop, mesh)| (steps(prop) - steps(mesh)).abs().max_element() > 16.0).count()
    };
    let (clear, fogged) = (off(), off());
    println!("{clear} pixels are off without fog, {fogged} in fog");
    assert!(fogged <= clear + 20, "{clear} pixels are off without fog, {fogged} in fog");
}
