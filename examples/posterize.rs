//! Posterizes a prop that stands among ordinary meshes.
//!
//! The plugin extracts the palette while the app runs: on the GPU, or in the background on the CPU. If there were a
//! file `toadstool.palette.json` next to the field, it would be loaded instead.
//!
//! ```sh
//! cargo run --release --example posterize
//! ```

use bevy::prelude::*;
use bevy_plenoctree::prelude::*;

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, PlenOctreePlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, rotate)
        .run();
}

pub fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    // Labels blend into one another a little. By default, they do not.
    let posterize = Posterize { softness: 0.1, ..default() };
    commands.spawn((Prop(assets.load("toadstool.plenoctree")), posterize));

    // Meshes occlude the prop, and the prop occludes meshes.
    let ground = meshes.add(Circle::new(3.0));
    let facing_up = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    commands.spawn((
        Mesh3d(ground),
        MeshMaterial3d(materials.add(Color::srgb(0.35, 0.5, 0.3))),
        Transform::from_xyz(0.0, -0.93, 0.0).with_rotation(facing_up),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Sphere::new(0.25))),
        MeshMaterial3d(materials.add(Color::srgb(0.9, 0.75, 0.3))),
        Transform::from_xyz(0.9, -0.68, 0.7),
    ));
    commands.spawn((DirectionalLight::default(), Transform::from_xyz(2.0, 4.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    commands.spawn((Camera3d::default(), Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y)));
}

fn rotate(time: Res<Time>, mut props: Query<&mut Transform, With<Prop>>) {
    for mut transform in &mut props {
        transform.rotate_y(0.3 * time.delta_secs());
    }
}
