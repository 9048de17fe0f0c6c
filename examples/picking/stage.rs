//! The shop: a bench with toys and tins, and a wall with pictures of the orders.

use bevy::{core_pipeline::tonemapping::Tonemapping, prelude::*};
use bevy_plenoctree::{BilateralFilter, PaletteOverride, Palettes, PlenOctree, Posterize, Prop};

use crate::{
    build::{Builder, color},
    game::{BLUE, Coat, MINT, ORANGE, PAINTS, PINK, Parts, Tin, Toy, VIOLET, YELLOW, dip, paint},
    stand::{Footprint, standing},
    tin,
};

pub fn plugin(app: &mut App) {
    app.insert_resource(ClearColor(color("#e9d7bd"))).add_systems(Startup, (spawn_shop, spawn_toys, spawn_tins));
}

const BARE: Coat = [None; 3];

/// A coat of one or two paints.
const fn coat<const N: usize>(paints: [(usize, usize); N]) -> Coat {
    let mut coat = BARE;
    let mut index = 0;
    while index < N {
        coat[paints[index].0] = Some(paints[index].1);
        index += 1;
    }
    coat
}

/// A kind of toy: its file, its position on the bench, its rotation about y in radians, the parts to
/// paint, and its orders, in sequence.
struct Kind {
    file: &'static str,
    x: f32,
    turn: f32,
    parts: Parts,
    orders: &'static [Coat],
}

const TOYS: [Kind; 3] = [
    Kind {
        file: "gumballs.plenoctree",
        x: -2.5,
        turn: 0.2,
        parts: ["body", "brass", "glass"],
        orders: &[coat([(0, PINK)]), coat([(0, MINT), (1, VIOLET)]), coat([(0, ORANGE), (1, BLUE)])],
    },
    Kind {
        file: "toadstool.plenoctree",
        x: 0.0,
        turn: 0.0,
        parts: ["red", "green", "gray"],
        orders: &[coat([(0, VIOLET)]), coat([(0, YELLOW), (1, BLUE)]), coat([(0, MINT), (1, PINK)])],
    },
    Kind {
        file: "robot.plenoctree",
        x: 2.5,
        turn: -0.25,
        parts: ["body", "trim", "metal"],
        orders: &[coat([(0, YELLOW), (1, BLUE)]), coat([(0, PINK), (2, VIOLET)]), coat([(0, ORANGE), (1, MINT)])],
    },
];

/// The z coordinate of the wall.
const WALL: f32 = -1.5;

fn spawn_shop(mut builder: Builder) {
    builder.commands.spawn((
        Camera3d::default(),
        Tonemapping::None,
        Projection::from(PerspectiveProjection { fov: 0.46, ..default() }),
        Transform::from_xyz(0.0, 3.1, 10.2).looking_at(Vec3::new(0.0, 1.5, 0.0), Vec3::Y),
    ));
    let sun = DirectionalLight { illuminance: 5500.0, ..default() };
    builder.commands.spawn((sun, Transform::from_xyz(-2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    builder.commands.insert_resource(GlobalAmbientLight { brightness: 900.0, ..default() });

    let matte = |hex: &str| StandardMaterial { base_color: color(hex), perceptual_roughness: 1.0, ..default() };
    let wall = Transform::from_xyz(0.0, 2.0, WALL - 0.1);
    builder.put(Rectangle::new(40.0, 20.0), matte("#e9d7bd"), wall);
    builder.put(Cuboid::new(14.0, 0.4, 6.0), matte("#b98a5b"), Transform::from_xyz(0.0, -0.2, 1.4));
    for Kind { x, .. } in TOYS {
        builder.put(Cuboid::new(1.5, 1.36, 0.08), matte("#7a4a2b"), Transform::from_xyz(x, 3.15, WALL));
        builder.put(Cuboid::new(1.34, 1.2, 0.1), matte("#fbf4e4"), Transform::from_xyz(x, 3.15, WALL));
        builder.put(Cylinder::new(1.1, 0.12), matte("#d9b283"), Transform::from_xyz(x, 0.06, 0.0));
    }
}

fn spawn_toys(mut commands: Commands, assets: Res<AssetServer>) {
    for Kind { file, x, turn, parts, orders } in TOYS {
        let field = assets.load(file);
        // Flatten the prop into a picture.
        let hung = Transform::from_xyz(x, 3.15, WALL + 0.1)
            .with_rotation(Quat::from_rotation_y(0.3 * turn))
            .with_scale(Vec3::new(0.52, 0.52, 0.04));
        let posterize = Posterize { filter: BilateralFilter { iterations: 1, ..default() }, ..default() };
        let picture =
            commands.spawn((Prop(field.clone()), posterize, PaletteOverride::default(), hung, Pickable::IGNORE)).id();
        let home = standing(Vec3::new(x, 0.12, 0.0), 1.0, turn);
        let toy = Toy::new(parts, orders, picture, home);
        commands
            .spawn((Prop(field), Posterize::default(), PaletteOverride::default(), toy, home, Footprint::of(file)))
            .observe(paint);
    }
}

fn spawn_tins(
    mut commands: Commands,
    mut fields: ResMut<Assets<PlenOctree>>,
    mut palettes: ResMut<Palettes>,
) -> Result {
    let field = fields.add(tin::field()?);
    palettes.insert(&field, tin::palette()?);
    for (paint, &paint_color) in PAINTS.iter().enumerate() {
        let x = 0.95 * (paint as f32 - 0.5 * (PAINTS.len() - 1) as f32);
        let home = Transform::from_xyz(x, 0.0, 2.6).with_scale(Vec3::splat(0.7));
        let colors = PaletteOverride::default().with(tin::PAINT, paint_color);
        commands.spawn((Prop(field.clone()), Posterize::default(), colors, Tin { paint, home }, home)).observe(dip);
    }
    Ok(())
}
