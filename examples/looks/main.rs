//! One prop in the looks that have names: as trained, the paper's, a cartoon's, recolored, and a comic's.
//!
//! ```sh
//! cargo run --release --example looks
//! cargo run --release --example looks -- --headless looks.png --size 1600x400
//! ```

#[path = "../common/show.rs"]
mod show;

use std::process::ExitCode;

use bevy::{camera::ScalingMode, core_pipeline::tonemapping::Tonemapping, prelude::*};
use bevy_plenoctree::prelude::*;
use clap::Parser;

use show::Show;

/// Shows one prop in several looks, side by side.
#[derive(Parser)]
struct Arguments {
    #[command(flatten)]
    show: Show,
}

/// The distance between two props.
const STEP: f32 = 2.1;

/// A copy of the field: each field has one palette, and the paper's look needs its own.
#[derive(Resource)]
struct Again {
    field: Handle<PlenOctree>,
    copy: Handle<PlenOctree>,
}

fn main() -> ExitCode {
    let show = Arguments::parse().show;
    show::exit_code(show.run(
        "Looks",
        |app| {
            app.add_plugins(PlenOctreePlugin)
                .insert_resource(ClearColor(Color::srgb(0.96, 0.94, 0.88)))
                .add_systems(Startup, setup)
                .add_systems(Update, (copy, rotate));
        },
        show::wait_for_props,
    ))
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, fields: Res<Assets<PlenOctree>>) {
    let field: Handle<PlenOctree> = assets.load("toadstool.plenoctree");
    let copy = fields.reserve_handle();
    let place = |column: f32| Transform::from_xyz(STEP * column, 0.0, 0.0).with_rotation(Quat::from_rotation_y(0.35));
    commands.spawn((Prop(field.clone()), place(-2.0)));
    commands.spawn((Prop(copy.clone()), Posterize::paper(), place(-1.0)));
    commands.spawn((Prop(field.clone()), Posterize::toon(), place(0.0)));
    let blue = PaletteOverride::default().with_ramp("red", Color::srgb(0.2, 0.35, 0.8));
    commands.spawn((Prop(field.clone()), Posterize::toon(), blue, place(1.0)));
    commands.spawn((Prop(field.clone()), Posterize::comic(), place(2.0)));
    commands.insert_resource(Again { field, copy });

    // Orthographic, so that all are seen from the same side.
    let scaling_mode = ScalingMode::FixedHorizontal { viewport_width: 5.0 * STEP };
    commands.spawn((
        Camera3d::default(),
        Tonemapping::None,
        Projection::from(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() }),
        Transform::from_xyz(0.0, 2.2, 8.0).looking_at(Vec3::new(0.0, 0.05, 0.0), Vec3::Y),
    ));
}

fn copy(again: Res<Again>, mut fields: ResMut<Assets<PlenOctree>>) -> Result {
    if !fields.contains(&again.copy)
        && let Some(field) = fields.get(&again.field).cloned()
    {
        fields.insert(&again.copy, field)?;
    }
    Ok(())
}

fn rotate(time: Res<Time>, mut props: Query<&mut Transform, With<Prop>>) {
    for mut transform in &mut props {
        transform.rotate_y(0.4 * time.delta_secs());
    }
}
