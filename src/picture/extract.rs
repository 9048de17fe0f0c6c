//! From the main world to the render world, in buffers that are used again in every frame.

use std::any::TypeId;

use bevy::{
    camera::visibility::VisibleEntities,
    ecs::entity::EntityHashMap,
    prelude::*,
    render::{Extract, sync_world::RenderEntity},
};

use super::{rays::Placement, view::ViewProps};
use crate::{
    field::PlenOctree,
    palette::Palette,
    palettes::{FieldPalette, PaletteOverride, Palettes},
    prop::{Posterize, Prop},
};

/// Every prop that some camera may see, in this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedProps {
    pub props: Vec<ExtractedProp>,
    /// The colours of all props.
    pub colors: Vec<Vec4>,
    index: EntityHashMap<usize>,
}

pub(super) struct ExtractedProp {
    pub field: AssetId<PlenOctree>,
    pub placement: Placement,
    /// The look and its palette, if the prop has both.
    pub look: Option<(Posterize, PaletteColors)>,
}

/// The palette of one prop in [`ExtractedProps::colors`]: the extracted colours, encoded sRGB, and as many shown ones.
#[derive(Clone, Copy)]
pub(super) struct PaletteColors {
    pub first: u32,
    /// How many extracted colours there are.
    pub count: u32,
}

impl PaletteColors {
    fn write(colors: &mut Vec<Vec4>, palette: &FieldPalette, own: Option<&PaletteOverride>) -> Self {
        let first = colors.len() as u32;
        // What no shader can go through in time is not shown.
        let extracted = palette.extracted().colors.get(..Palette::MAX_COLORS).unwrap_or(&palette.extracted().colors);
        colors.extend(extracted.iter().map(|c| glam::DVec3::from(*c).as_vec3().extend(0.0)));
        colors.extend(extracted.iter().enumerate().map(|(index, extracted)| {
            let shown = own.and_then(|own| own.get(index)).or_else(|| palette.shown().get(index).copied());
            let encoded = shown.map(|color| Srgba::from(color).to_vec3());
            encoded.unwrap_or_else(|| glam::DVec3::from(*extracted).as_vec3()).extend(0.0)
        }));
        Self { first, count: extracted.len() as u32 }
    }
}

/// The props that a camera sees, by their place in [`ExtractedProps`].
#[derive(Component, Default)]
pub(super) struct VisibleProps(pub Vec<usize>);

/// What decides on a prop's colours, besides its field's palette.
type Look = (Option<&'static Posterize>, Option<&'static PaletteOverride>);

pub(super) fn extract_props(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedProps>,
    mut views: Query<&mut VisibleProps>,
    fields: Extract<Res<Assets<PlenOctree>>>,
    palettes: Extract<Res<Palettes>>,
    props: Extract<Query<(Entity, &Prop, Look, &GlobalTransform, &ViewVisibility)>>,
    cameras: Extract<Query<(RenderEntity, &VisibleEntities), With<Camera3d>>>,
) {
    let ExtractedProps { props: list, colors, index } = &mut *extracted;
    list.clear();
    colors.clear();
    index.clear();
    for (entity, prop, (look, own), transform, visibility) in &props {
        let Some(field) = fields.get(&prop.0).filter(|_| visibility.get()) else {
            continue;
        };
        let Some((low, high)) = field.cell_bounds() else {
            continue;
        };
        let cells = f64::from(1u32 << field.depth());
        let look = look.zip(palettes.get(&prop.0));
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
            look: look.map(|(look, palette)| (*look, PaletteColors::write(colors, palette, own))),
        });
    }
    for (camera, visible) in &cameras {
        let seen = visible.iter(TypeId::of::<Prop>()).filter_map(|entity| index.get(entity).copied());
        if let Ok(mut view) = views.get_mut(camera) {
            view.0.clear();
            view.0.extend(seen);
        } else {
            commands.entity(camera).insert((VisibleProps(seen.collect()), ViewProps::default()));
        }
    }
}
