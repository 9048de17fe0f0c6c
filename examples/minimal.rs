//! Loads a field, extracts the palette of all of it, and draws it posterized.
//!
//! There is no palette file next to the field. So when the field arrives, it is sampled: on a GPU in compute shaders, a
//! slice per frame, and otherwise on background threads. The log says which, and the prop appears when that is done.
//!
//! ```sh
//! cargo run --release --example minimal
//! ```

use bevy::prelude::*;
use bevy_plenoctree::prelude::*;

fn main() {
    App::new().add_plugins((DefaultPlugins, PlenOctreePlugin)).add_systems(Startup, setup).run();
}

pub fn setup(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::default()));
    commands.spawn((Camera3d::default(), Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y)));
}
