//! Walls, furniture and glass.

use bevy::{light::NotShadowCaster, prelude::*};

use crate::{
    build::{Builder, color},
    game::Lever,
};

pub fn plugin(app: &mut App) {
    app.add_systems(Startup, (build_walls, furnish, spawn_glass, mount_lever));
}

/// Where the bell jar stands: the top of its base.
pub const JAR: Vec3 = Vec3::new(0.35, 0.16, -0.7);
/// Where the bottle stands.
pub const BOTTLE: Vec3 = Vec3::new(-2.35, 0.0, 1.9);
/// The top of the table.
pub const TABLE: Vec3 = Vec3::new(2.75, 0.72, -1.35);

const WALL: &str = "#93b4cc";
const PANEL: &str = "#e8dcc0";
const WOOD: &str = "#8a5a36";

fn cuboid(builder: &mut Builder, paint: &str, center: Vec3, size: Vec3) {
    let material = StandardMaterial { perceptual_roughness: 0.75, ..color(paint).into() };
    builder.put(Cuboid::from_size(size), material, Transform::from_translation(center));
}

fn build_walls(mut builder: Builder) {
    let planks = ["#a8713f", "#b47c48", "#9c6839", "#ad7644"];
    for (index, paint) in planks.iter().cycle().take(20).enumerate() {
        let x = index as f32 * 0.52 - 4.94;
        cuboid(&mut builder, paint, Vec3::new(x, -0.1, 0.5), Vec3::new(0.51, 0.2, 8.0));
    }
    cuboid(&mut builder, "#4a3220", Vec3::new(0.0, -0.15, 0.5), Vec3::new(10.4, 0.2, 8.0));
    cuboid(&mut builder, PANEL, Vec3::new(0.0, 4.7, 0.5), Vec3::new(10.6, 0.2, 8.0));
    cuboid(&mut builder, WALL, Vec3::new(-5.1, 2.3, 0.5), Vec3::new(0.2, 4.6, 8.0));
    cuboid(&mut builder, WALL, Vec3::new(5.1, 2.3, 0.5), Vec3::new(0.2, 4.6, 8.0));

    // The back wall has a window of 2.2 by 1.9 units.
    let (left, right, low, high) = (-4.1, -1.9, 1.6, 3.5);
    let back = |center: Vec2, size: Vec2| (center.extend(-3.2), size.extend(0.2));
    for (center, size) in [
        back(Vec2::new(0.5 * (left - 5.0), 2.3), Vec2::new(left + 5.0, 4.6)),
        back(Vec2::new(0.5 * (right + 5.0), 2.3), Vec2::new(5.0 - right, 4.6)),
        back(Vec2::new(0.5 * (left + right), 0.5 * low), Vec2::new(right - left, low)),
        back(Vec2::new(0.5 * (left + right), 0.5 * (high + 4.6)), Vec2::new(right - left, 4.6 - high)),
    ] {
        cuboid(&mut builder, WALL, center, size);
    }
    let bar = |x: f32, y: f32, width: f32, height: f32| (Vec3::new(x, y, -3.12), Vec3::new(width, height, 0.16));
    for (center, size) in [
        bar(left, 2.55, 0.12, 2.02),
        bar(right, 2.55, 0.12, 2.02),
        bar(-3.0, 2.55, 0.08, 1.9),
        bar(-3.0, high, 2.32, 0.12),
        bar(-3.0, 2.55, 2.2, 0.08),
    ] {
        cuboid(&mut builder, PANEL, center, size);
    }
    cuboid(&mut builder, PANEL, Vec3::new(-3.0, low - 0.05, -3.0), Vec3::new(2.6, 0.1, 0.36));
    // Paneling and baseboards.
    cuboid(&mut builder, PANEL, Vec3::new(0.0, 0.6, -3.08), Vec3::new(10.0, 1.2, 0.06));
    cuboid(&mut builder, WOOD, Vec3::new(0.0, 1.22, -3.06), Vec3::new(10.0, 0.08, 0.12));
    cuboid(&mut builder, WOOD, Vec3::new(0.0, 0.09, -3.05), Vec3::new(10.0, 0.18, 0.1));
}

fn furnish(mut builder: Builder) {
    // A rug of stacked discs, the largest at the bottom.
    let rug = [(2.85, "#b8433f"), (2.6, "#efe0bf"), (2.45, "#b8433f"), (1.95, "#335c67"), (1.85, "#efe0bf")];
    for (layer, (radius, paint)) in rug.into_iter().enumerate() {
        let place = Transform::from_xyz(JAR.x, 0.01 * (layer + 1) as f32 - 0.008, JAR.z);
        let material = StandardMaterial { perceptual_roughness: 1.0, reflectance: 0.1, ..color(paint).into() };
        builder.put(Cylinder::new(radius, 0.01).mesh().resolution(96), material, place);
    }
    // The base of the jar, and the table.
    let round = |radius: f32, height: f32| Cylinder::new(radius, height).mesh().resolution(64).build();
    builder.put(round(1.68, 0.16), color(WOOD), Transform::from_translation(JAR.with_y(0.5 * JAR.y)));
    builder.put(round(0.95, 0.08), color(WOOD), Transform::from_translation(TABLE - 0.04 * Vec3::Y));
    builder.put(round(0.1, TABLE.y), color(WOOD), Transform::from_translation(TABLE - 0.5 * TABLE.y * Vec3::Y));
    builder.put(round(0.5, 0.06), color(WOOD), Transform::from_translation(TABLE.with_y(0.03)));

    // Books on a shelf.
    cuboid(&mut builder, WOOD, Vec3::new(2.3, 2.85, -2.9), Vec3::new(2.2, 0.08, 0.5));
    let books = ["#b23a48", "#2f6690", "#e0a458", "#3a7d44", "#6d597a", "#d98f6c", "#274c77", "#a3b18a", "#8d3b3b"];
    let mut x = 1.3;
    for (index, paint) in books.into_iter().enumerate() {
        let (width, height) = (0.13 + 0.03 * (index % 3) as f32, 0.62 + 0.09 * (index * 5 % 4) as f32);
        cuboid(
            &mut builder,
            paint,
            Vec3::new(x + 0.5 * width, 2.89 + 0.5 * height, -2.92),
            Vec3::new(width, height, 0.4),
        );
        x += width + 0.012;
    }
    // Blocks and a ball, to cast shadows.
    for (paint, x, y, z, turn) in
        [("#d1495b", 3.05, 0.25, 1.35, 0.3), ("#edae49", 3.62, 0.25, 1.0, -0.2), ("#30638e", 3.3, 0.75, 1.2, 0.75)]
    {
        let place = Transform::from_xyz(x, y, z).with_rotation(Quat::from_rotation_y(turn));
        builder.put(Cuboid::from_length(0.5), color(paint), place);
    }
    let rubber = StandardMaterial { perceptual_roughness: 0.3, ..color("#c8403a").into() };
    builder.put(Sphere::new(0.32).mesh().uv(48, 24), rubber, Transform::from_xyz(2.3, 0.32, 1.95));
}

/// Returns a transparent material. It is drawn after the props and blends over everything behind it.
fn glass(tint: &str, opacity: f32) -> StandardMaterial {
    StandardMaterial {
        // Premultiplied alpha keeps the lamps' reflections bright, no matter how thin the glass is.
        base_color: (color(tint).to_linear() * opacity).with_alpha(opacity).into(),
        perceptual_roughness: 0.08,
        reflectance: 0.45,
        alpha_mode: AlphaMode::Premultiplied,
        ..default()
    }
}

fn spawn_glass(mut builder: Builder) {
    // The base hides the lower end of the capsule.
    let mut bell = |radius: f32, length: f32, material: StandardMaterial| {
        let place = Transform::from_translation(JAR + (0.2 + 0.5 * length) * Vec3::Y);
        builder
            .put(Capsule3d::new(radius, length).mesh().latitudes(32).longitudes(64), material, place)
            .insert(NotShadowCaster);
    };
    let pane = glass("#bfe6ee", 0.035);
    // The far side, seen from inside, is behind the toadstool; the near side is in front of it.
    bell(
        1.5,
        1.15,
        StandardMaterial {
            cull_mode: Some(bevy::render::render_resource::Face::Front),
            double_sided: true,
            ..pane.clone()
        },
    );
    bell(1.5, 1.15, pane.clone());
    builder
        .put(Sphere::new(0.13), glass("#bfe6ee", 0.4), Transform::from_translation(JAR + 2.97 * Vec3::Y))
        .insert(NotShadowCaster);

    let green = glass("#4fae6a", 0.35);
    for (shape, height) in [
        (Mesh::from(Cylinder::new(0.25, 0.66)), 0.33),
        (Mesh::from(ConicalFrustum { radius_top: 0.1, radius_bottom: 0.25, height: 0.2 }), 0.76),
        (Mesh::from(Cylinder::new(0.1, 0.22)), 0.97),
    ] {
        builder
            .put(shape, green.clone(), Transform::from_translation(BOTTLE + height * Vec3::Y))
            .insert(NotShadowCaster);
    }
    builder.put(Cylinder::new(0.09, 0.16), color("#b98b5c"), Transform::from_translation(BOTTLE + 1.1 * Vec3::Y));

    // The window pane.
    builder
        .put(Rectangle::new(2.2, 1.9), glass("#cfe8f0", 0.06), Transform::from_xyz(-3.0, 2.55, -3.15))
        .insert(NotShadowCaster);
}

fn mount_lever(mut builder: Builder) {
    let place = Vec3::new(-1.5, 2.0, -3.08);
    cuboid(&mut builder, "#d9cfb8", place, Vec3::new(0.36, 0.6, 0.06));
    let knob = StandardMaterial { metallic: 0.3, perceptual_roughness: 0.3, ..color("#c8403a").into() };
    let handle = builder.put(Cylinder::new(0.035, 0.4), color("#5b5b5b"), Transform::from_xyz(0.0, 0.2, 0.0)).id();
    let knob = builder.put(Sphere::new(0.09), knob, Transform::from_xyz(0.0, 0.42, 0.0)).id();
    let hinge = (Lever::default(), Transform::from_translation(place + 0.05 * Vec3::Z), Visibility::default());
    builder.commands.spawn(hinge).add_children(&[handle, knob]);
}
