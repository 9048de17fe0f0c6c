//! Helpers that spawn meshes.

use bevy::{ecs::system::SystemParam, prelude::*};

/// Spawns meshes with materials.
#[derive(SystemParam)]
pub struct Builder<'w, 's> {
    pub commands: Commands<'w, 's>,
    meshes: ResMut<'w, Assets<Mesh>>,
    materials: ResMut<'w, Assets<StandardMaterial>>,
}

impl Builder<'_, '_> {
    /// Spawns a mesh with its own material.
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

/// Parses a hex code from an example's source. Invalid codes become black.
pub fn color(hex: &str) -> Color {
    Srgba::hex(hex).unwrap_or(Srgba::BLACK).into()
}
