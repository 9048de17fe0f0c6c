//! From the main world to the render world.

use bevy::{
    camera::visibility::VisibleEntities,
    ecs::entity::EntityHashMap,
    prelude::*,
    render::{Extract, sync_world::RenderEntity},
};

use super::{Posterize, Prop, rays::Placement, view::ViewProps};
use crate::{field::PlenOctree, palettes::Palettes};

/// Every prop that some camera may see, in this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedProps {
    pub props: Vec<ExtractedProp>,
    index: EntityHashMap<usize>,
}

pub(super) struct ExtractedProp {
    pub field: AssetId<PlenOctree>,
    pub placement: Placement,
    /// The look and its palette, if the prop has both.
    pub look: Option<(Posterize, PaletteColors)>,
}

/// The palette of one prop, encoded sRGB: the extracted colours and as many shown ones.
#[derive(Clone)]
pub(super) struct PaletteColors {
    pub extracted: Vec<Vec3>,
    pub shown: Vec<Vec3>,
}

/// The props that a camera sees, by their place in [`ExtractedProps`].
#[derive(Component, Default)]
pub(super) struct VisibleProps(pub Vec<usize>);

pub(super) fn extract_props(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedProps>,
    fields: Extract<Res<Assets<PlenOctree>>>,
    palettes: Extract<Res<Palettes>>,
    props: Extract<Query<(Entity, &Prop, Option<&Posterize>, &GlobalTransform, &ViewVisibility)>>,
    cameras: Extract<Query<(RenderEntity, &VisibleEntities), With<Camera3d>>>,
) {
    let ExtractedProps { props: list, index } = &mut *extracted;
    list.clear();
    index.clear();
    for (entity, prop, look, transform, visibility) in &props {
        let Some(field) = fields.get(&prop.0).filter(|_| visibility.get()) else {
            continue;
        };
        let Some((low, high)) = field.cell_bounds() else {
            continue;
        };
        let cells = f64::from(1u32 << field.depth());
        let colors = palettes.get(&prop.0).map(|palette| PaletteColors {
            extracted: palette.extracted().colors.iter().map(|c| glam::DVec3::from(*c).as_vec3()).collect(),
            shown: palette.shown().iter().map(|color| Srgba::from(*color).to_vec3()).collect(),
        });
        index.insert(entity, list.len());
        list.push(ExtractedProp {
            field: prop.0.id(),
            placement: Placement {
                world_from_prop: *transform,
                up: field.up(),
                frame: field.frame(),
                low: low.as_dvec3() / cells,
                high: high.as_dvec3() / cells,
            },
            look: look.copied().zip(colors),
        });
    }
    for (camera, visible) in &cameras {
        let seen = visible.iter(std::any::TypeId::of::<Prop>()).filter_map(|entity| index.get(entity).copied());
        commands.entity(camera).insert(VisibleProps(seen.collect())).insert_if_new(ViewProps::default());
    }
}
