//! Lights, by day and by night.

use bevy::{
    light::{
        CascadeShadowConfigBuilder, DirectionalLightShadowMap, GlobalAmbientLight, NotShadowCaster, PointLightShadowMap,
    },
    prelude::*,
};
use bevy_plenoctree::BlendSpace;

use crate::{
    build::{Builder, color},
    night::Night,
    room::BOTTLE,
};

pub fn plugin(app: &mut App) {
    // The room is small enough for maps of half the default size.
    app.insert_resource(DirectionalLightShadowMap { size: 1024 })
        .insert_resource(PointLightShadowMap { size: 512 })
        .add_systems(Startup, (light_sun, hang_fairy_lights, spawn_lamp, spawn_sky, fill_bottle))
        .add_systems(PostUpdate, (dim_lights, dim_glows));
}

/// The brightness of a light by day and by night, in the light's own unit.
#[derive(Component)]
struct Dimmed([f32; 2]);

/// The light that a mesh emits by day and by night. 1 is as bright as white paper.
#[derive(Component)]
struct Glow([LinearRgba; 2]);

const AMBIENT: [f32; 2] = [1_000.0, 120.0];
const AMBIENT_COLORS: [&str; 2] = ["#fff3df", "#6f86e8"];

fn light_sun(mut commands: Commands) {
    commands.spawn((
        DirectionalLight { color: color("#ffe3b0"), shadow_maps_enabled: true, ..default() },
        Dimmed([34_000.0, 0.0]),
        // Shines through the window into the middle of the room.
        Transform::default().looking_to(Vec3::new(0.62, -0.62, 0.95), Vec3::Y),
        CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 18.0, ..default() }.build(),
    ));
    // Stands in for the light that the walls reflect. It comes from near the camera.
    commands.spawn((
        PointLight { color: color("#ffe9cf"), shadow_maps_enabled: true, range: 20.0, ..default() },
        Dimmed([900_000.0, 60_000.0]),
        Transform::from_xyz(-1.0, 3.6, 5.0),
    ));
}

fn spawn_lamp(mut builder: Builder) {
    let foot = Vec3::new(3.9, 0.0, -1.9);
    let brass = StandardMaterial { metallic: 0.6, perceptual_roughness: 0.4, ..color("#b08a3e").into() };
    builder.put(Cylinder::new(0.42, 0.08), brass.clone(), Transform::from_translation(foot + 0.04 * Vec3::Y));
    builder.put(Cylinder::new(0.05, 2.5), brass, Transform::from_translation(foot + 1.25 * Vec3::Y));
    let shade = ConicalFrustum { radius_top: 0.34, radius_bottom: 0.66, height: 0.72 };
    let bulb = foot + 2.75 * Vec3::Y;
    // The lamp is lit from inside, so the shade glows and casts no shadow.
    let warm = LinearRgba::rgb(2.4, 1.3, 0.45);
    builder
        .put(shade, color("#f3dfb8"), Transform::from_translation(bulb))
        .insert((NotShadowCaster, Glow([LinearRgba::BLACK, warm])));
    builder.commands.spawn((
        PointLight { color: color("#ffc98a"), shadow_maps_enabled: true, range: 14.0, radius: 0.2, ..default() },
        Dimmed([0.0, 300_000.0]),
        Transform::from_translation(bulb),
    ));
}

/// Hangs fairy lights along the back wall, on a slack string.
fn hang_fairy_lights(mut builder: Builder) {
    let hues = ["#ff5a4d", "#ffc24d", "#59e08a", "#5aa8ff", "#d66bff"].map(color);
    for (index, hue) in hues.iter().cycle().take(21).enumerate() {
        let across = index as f32 / 20.0;
        let slack = (across * 3.0).fract();
        let place = Vec3::new(9.6 * across - 4.8, 4.25 - 1.6 * slack * (1.0 - slack), -2.95);
        let light = LinearRgba::from(*hue);
        builder
            .put(Sphere::new(0.075), *hue, Transform::from_translation(place))
            .insert((NotShadowCaster, Glow([0.1 * light, 7.0 * light])));
    }
}

/// Spawns the sky and the moon behind the window.
fn spawn_sky(mut builder: Builder) {
    let dark = |material: StandardMaterial| StandardMaterial { base_color: Color::BLACK, ..material };
    let day = LinearRgba::from(color("#a9dcf5")) * 1.3;
    builder
        .put(Rectangle::new(9.0, 9.0), dark(default()), Transform::from_xyz(-4.5, 3.0, -7.0))
        .insert((NotShadowCaster, Glow([day, LinearRgba::rgb(0.008, 0.014, 0.06)])));
    let moon = LinearRgba::rgb(3.2, 3.3, 2.6);
    builder
        .put(Circle::new(0.42), dark(default()), Transform::from_xyz(-4.15, 3.3, -6.9))
        .insert((NotShadowCaster, Glow([day, moon])));
}

/// Fills the bottle with fireflies.
fn fill_bottle(mut builder: Builder) {
    for (x, y, z) in [(0.08, 0.22, 0.05), (-0.1, 0.4, 0.0), (0.05, 0.58, -0.08), (-0.04, 0.3, 0.12), (0.1, 0.46, 0.06)]
    {
        let light = LinearRgba::rgb(2.4, 3.6, 0.6);
        builder
            .put(Sphere::new(0.028), Color::BLACK, Transform::from_translation(BOTTLE + Vec3::new(x, y, z)))
            .insert((NotShadowCaster, Glow([0.2 * light, 3.0 * light])));
    }
    builder.commands.spawn((
        PointLight { color: color("#d8ff8a"), range: 4.0, ..default() },
        Dimmed([0.0, 60_000.0]),
        Transform::from_translation(BOTTLE + 0.4 * Vec3::Y),
    ));
}

fn dim_lights(
    night: Res<Night>,
    mut ambient: ResMut<GlobalAmbientLight>,
    mut lamps: Query<(&Dimmed, &mut PointLight)>,
    mut suns: Query<(&Dimmed, &mut DirectionalLight)>,
) {
    let now = |[day, dark]: [f32; 2]| day.lerp(dark, night.0);
    ambient.brightness = now(AMBIENT);
    ambient.color = BlendSpace::Oklab.mix(color(AMBIENT_COLORS[0]), color(AMBIENT_COLORS[1]), night.0);
    for (dimmed, mut lamp) in &mut lamps {
        lamp.intensity = now(dimmed.0);
    }
    for (dimmed, mut sun) in &mut suns {
        sun.illuminance = now(dimmed.0);
    }
}

fn dim_glows(
    night: Res<Night>,
    glows: Query<(&Glow, &MeshMaterial3d<StandardMaterial>)>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (Glow([day, dark]), material) in &glows {
        if let Some(mut material) = materials.get_mut(&material.0) {
            material.emissive = day.mix(dark, night.0);
        }
    }
}
