//! Meshes in few words.

use bevy::{ecs::system::SystemParam, prelude::*};

/// Puts meshes into the world.
#[derive(SystemParam)]
pub struct Builder<'w, 's> {
    pub commands: Commands<'w, 's>,
    meshes: ResMut<'w, Assets<Mesh>>,
    materials: ResMut<'w, Assets<StandardMaterial>>,
}

impl Builder<'_, '_> {
    /// Spawns a mesh of its own material.
    pub fn put(
        &mut self,
        shape: impl Into<Mesh>,
        material: impl Into<StandardMaterial>,
        place: Transform,
    ) -> EntityCommands<'_> {
        let material = MeshMaterial3d(self.materials.add(material));
        self.commands.spawn((Mesh3d(self.meshes.add(shape)), material, place))
    }
}

/// The color of a hex code of the source.
pub fn color(hex: &str) -> Color {
    Srgba::hex(hex).unwrap_or(Srgba::BLACK).into()
}
