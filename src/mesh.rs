//! Surfaces of fields as meshes.

use bevy::{
    asset::RenderAssetUsages,
    mesh::{Indices, Mesh, PrimitiveTopology},
};
use glam::DVec3;
use plenoctree::{MeshError, PlenOctree};

/// Returns the surface of the solid parts of a field as a mesh, for colliders, navigation or shadows.
///
/// It is in the frame of the field's [`Prop`](crate::Prop), with y up. Add a collider of it to the same entity, but a
/// `Mesh3d` to a child: Bevy would cull the prop by the box of the mesh, which leaves out what is not solid.
/// A part is solid if it absorbs `opacity` of the light (more than 0, less than 1) within `cell_size`, the width of the
/// mesh's cells in units of the field. [`PlenOctree::surface_mesh`] says more, and returns plain vertices and
/// triangles.
///
/// This takes a while for a large field or small cells. In a running app, call it from a task.
///
/// # Errors
///
/// Returns the same errors as [`PlenOctree::surface_mesh`].
pub fn surface_mesh(field: &PlenOctree, opacity: f64, cell_size: f64) -> Result<Mesh, MeshError> {
    let surface = field.surface_mesh(opacity, cell_size)?;
    let turn = field.up().to_y_up();
    let turned = |at: &[f32; 3]| (turn * DVec3::from(at.map(f64::from))).as_vec3().to_array();
    let positions: Vec<[f32; 3]> = surface.vertices.iter().map(turned).collect();
    Ok(Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32(surface.triangles.into_flattened()))
        .with_computed_normals())
}

#[cfg(test)]
mod tests {
    use bevy::mesh::VertexAttributeValues;
    use plenoctree::{BakeSettings, Basis, bake};

    use super::*;

    /// A ball above the middle of a field whose z axis points up is above the middle of its prop. Normals face outward.
    #[test]
    fn meshes_stand_as_props_do() {
        let settings = BakeSettings { depth: 5, basis: Basis::Rgba, ..Default::default() };
        let center = DVec3::new(0.0, 0.0, 0.5);
        let inside = |at: DVec3| if at.distance(center) < 0.3 { 900.0 } else { 0.0 };
        let field = bake(&settings, inside, |_| |_| DVec3::ONE).unwrap();
        let mesh = surface_mesh(&field, 0.5, 0.07).unwrap();
        let values = |attribute| match mesh.attribute(attribute) {
            Some(VertexAttributeValues::Float32x3(values)) => values.clone(),
            other => panic!("{other:?}"),
        };
        let (positions, normals) = (values(Mesh::ATTRIBUTE_POSITION), values(Mesh::ATTRIBUTE_NORMAL));
        assert!(positions.len() > 100 && mesh.indices().is_some());
        for (position, normal) in positions.into_iter().zip(normals) {
            let outward = DVec3::from(position.map(f64::from)) - DVec3::new(0.0, 0.5, 0.0);
            assert!((outward.length() - 0.3).abs() < 0.06, "{position:?}");
            assert!(outward.normalize().dot(DVec3::from(normal.map(f64::from))) > 0.7, "{position:?} {normal:?}");
        }
    }
}
