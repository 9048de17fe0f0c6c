//! The props, and what can be done with them.

use bevy::prelude::*;
use bevy_plenoctree::{Ink, prelude::*};

/// Marks the props that are saved.
#[derive(Component, Clone, Default, Reflect)]
#[reflect(Component, Default)]
pub struct Toy;

pub fn plugin(app: &mut App) {
    app.register_type::<Toy>().add_systems(Startup, spawn_camera).add_systems(Update, change);
}

fn spawn_camera(mut commands: Commands) {
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.3, 5.5).looking_at(Vec3::ZERO, Vec3::Y)));
}

/// Spawns the props as they are before anything is saved.
pub fn spawn(world: &mut World) {
    let [robot, drum] =
        ["robot", "drum"].map(|name| world.resource::<AssetServer>().load(format!("{name}.plenoctree")));
    let at = |x| Transform::from_xyz(x, 0.0, 0.0);
    world.spawn((Toy, Name::new("inked robot"), Prop(robot.clone()), Posterize::comic(), at(-2.0)));
    let orange = PaletteOverride::default().with_ramp("body", Color::srgb(0.9, 0.6, 0.1));
    world.spawn((Toy, Name::new("orange robot"), Prop(robot), Posterize::toon(), orange, at(0.0)));
    world.spawn((Toy, Name::new("soft drum"), Prop(drum), Posterize::soft(), at(2.0)));
}

/// Turns all props, recolors them, and takes their ink or gives them some.
fn change(
    keys: Option<Res<ButtonInput<KeyCode>>>,
    time: Res<Time>,
    mut toys: Query<(Entity, &mut Transform, Has<Ink>), With<Toy>>,
    mut commands: Commands,
) {
    if !keys.is_some_and(|keys| keys.just_pressed(KeyCode::Space)) {
        return;
    }
    for (index, (toy, mut transform, has_ink)) in toys.iter_mut().enumerate() {
        transform.rotate_y(0.5);
        let hue = (97.0 * time.elapsed_secs() + 120.0 * index as f32) % 360.0;
        let mut toy = commands.entity(toy);
        toy.insert(PaletteOverride::default().with(0, Color::hsl(hue, 0.7, 0.5)));
        if has_ink {
            toy.remove::<Ink>();
        } else {
            toy.insert(Ink::default());
        }
    }
}
