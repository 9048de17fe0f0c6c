//! Loads a field and draws it as trained.
//!
//! ```sh
//! cargo run --release --example minimal
//! ```

use bevy::prelude::*;
use bevy_plenoctree::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, PlenOctreePlugin)).add_systems(Startup, setup).run();
}

fn setup(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn(Prop(assets.load("toadstool.plenoctree")));
    commands.spawn((Camera3d::default(), Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y)));
}
