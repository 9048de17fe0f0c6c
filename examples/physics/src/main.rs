//! Drops props onto the ground, where a ball knocks them over. Push the ball with the arrow keys; until then, it rolls
//! in circles. Space drops the props again.
//!
//! The colliders are made of the surfaces of the fields, in tasks. The physics engine is `avian3d`.
//!
//! ```sh
//! cargo run --profile quick --manifest-path examples/physics/Cargo.toml
//! ```

use avian3d::prelude::*;
use bevy::{
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task, block_on, poll_once},
};
use bevy_plenoctree::{prelude::*, surface_mesh};

fn main() {
    // Your own app has an `assets` folder, and does not need this path.
    let assets = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets");
    App::new()
        .add_plugins(DefaultPlugins.set(AssetPlugin { file_path: assets.into(), ..default() }))
        .add_plugins(drops_props)
        .run();
}

fn drops_props(app: &mut App) {
    app.add_plugins((PhysicsPlugins::default(), PlenOctreePlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, (begin_colliders, finish_colliders, push_ball, drop_again));
}

/// The radius of the ball.
const RADIUS: f32 = 0.45;
/// How fast the ball rolls.
const SPEED: f32 = 4.0;

#[derive(Component)]
struct Ball;

/// Where a prop falls from.
#[derive(Component)]
struct Start(Transform);

/// A prop whose collider is not being made yet.
#[derive(Component)]
struct NeedsCollider;

/// A collider that is being made.
#[derive(Component)]
struct ColliderTask(Task<Option<Collider>>);

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let names = ["toadstool", "drum", "robot", "gumballs"];
    for (index, name) in names.into_iter().enumerate() {
        let place = Quat::from_rotation_y(index as f32 * 1.6) * Vec3::new(1.7, 2.5, 0.0);
        let start = Transform::from_translation(place).with_rotation(Quat::from_rotation_z(0.25));
        let field = assets.load(format!("{name}.plenoctree"));
        commands.spawn((Prop(field), Posterize::default(), start, Start(start), NeedsCollider));
    }
    commands.spawn((
        Mesh3d(meshes.add(Cuboid::new(24.0, 0.5, 24.0))),
        MeshMaterial3d(materials.add(Color::srgb(0.45, 0.55, 0.42))),
        Transform::from_xyz(0.0, -0.25, 0.0),
        RigidBody::Static,
        Collider::cuboid(24.0, 0.5, 24.0),
    ));
    commands.spawn((
        Ball,
        Mesh3d(meshes.add(Sphere::new(RADIUS))),
        MeshMaterial3d(materials.add(Color::srgb(0.85, 0.3, 0.2))),
        Transform::from_xyz(4.0, RADIUS, 0.0),
        RigidBody::Dynamic,
        Collider::sphere(RADIUS),
        ColliderDensity(20.0),
    ));
    commands.spawn((
        DirectionalLight { shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(2.0, 5.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 4.5, 9.0).looking_at(Vec3::ZERO, Vec3::Y)));
}

/// Starts making the colliders of props whose fields are loaded.
fn begin_colliders(
    mut commands: Commands,
    fields: Res<Assets<PlenOctree>>,
    props: Query<(Entity, &Prop), With<NeedsCollider>>,
) {
    for (entity, prop) in &props {
        let Some(field) = fields.get(&prop.0).cloned() else { continue };
        let collider = async move {
            let surface = surface_mesh(&field, 0.5, 0.1).ok()?;
            // Moving bodies need a volume, so the surface is split into convex parts.
            let parts = VhacdParameters { resolution: 24, concavity: 0.03, ..default() };
            Collider::convex_decomposition_from_mesh_with_config(&surface, &parts)
        };
        let task = AsyncComputeTaskPool::get().spawn(collider);
        commands.entity(entity).remove::<NeedsCollider>().insert(ColliderTask(task));
    }
}

/// Drops the props whose colliders are ready. A prop of which no collider can be made stays where it is.
fn finish_colliders(mut commands: Commands, mut props: Query<(Entity, &mut ColliderTask)>) {
    for (entity, mut task) in &mut props {
        let Some(made) = block_on(poll_once(&mut task.0)) else { continue };
        // A task that has ended must not be polled again.
        commands.entity(entity).remove::<ColliderTask>();
        if let Some(collider) = made {
            commands.entity(entity).insert((collider, RigidBody::Dynamic));
        }
    }
}

fn push_ball(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    mut by_hand: Local<bool>,
    mut balls: Query<(&mut Transform, &mut LinearVelocity), With<Ball>>,
) {
    let axis = |low, high| f32::from(keys.pressed(high)) - f32::from(keys.pressed(low));
    let push =
        Vec3::new(axis(KeyCode::ArrowLeft, KeyCode::ArrowRight), 0.0, axis(KeyCode::ArrowUp, KeyCode::ArrowDown));
    *by_hand |= push != Vec3::ZERO;
    for (mut place, mut velocity) in &mut balls {
        let wanted = if *by_hand {
            SPEED * push
        } else {
            // Roll in circles through the props.
            let outward = place.translation.with_y(0.0);
            SPEED * (outward.cross(Vec3::Y) - (outward.length() - 1.7) * outward).normalize_or_zero()
        };
        let change = (wanted - velocity.0) * (3.0 * time.delta_secs()).min(1.0);
        velocity.0 += change.with_y(0.0);
        if place.translation.y < -5.0 {
            place.translation = Vec3::new(4.0, 3.0, 0.0);
            velocity.0 = Vec3::ZERO;
        }
    }
}

fn drop_again(
    keys: Res<ButtonInput<KeyCode>>,
    mut props: Query<(&Start, &mut Transform, &mut LinearVelocity, &mut AngularVelocity)>,
) {
    if keys.just_pressed(KeyCode::Space) {
        for (start, mut place, mut velocity, mut spin) in &mut props {
            *place = start.0;
            (velocity.0, spin.0) = (Vec3::ZERO, Vec3::ZERO);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bevy_plenoctree::headless::{Headless, LitMeshPlugins};

    use super::*;

    /// Props fall, on a device with no more than browsers grant.
    #[test]
    fn props_fall_within_the_default_limits_of_webgpu() {
        let mut headless = Headless::with_limits(UVec2::new(320, 200), wgpu::Limits::default(), |app| {
            app.add_plugins((LitMeshPlugins, drops_props));
        })
        .unwrap();
        let target = headless.target();
        headless.app.add_observer(move |camera: On<Add, Camera>, mut commands: Commands| {
            commands.entity(camera.entity).insert(target.clone());
        });
        headless.wait_until_ready(Duration::from_secs(600)).unwrap();
        let before = headless.capture().unwrap();
        let world = headless.app.world_mut();
        let mut props = world.query::<(&Start, &Transform)>();
        while !props.iter(headless.app.world()).all(|(start, place)| place.translation.y < start.0.translation.y - 1.0)
        {
            headless.update();
        }
        assert!(headless.capture().unwrap() != before);
    }
}
