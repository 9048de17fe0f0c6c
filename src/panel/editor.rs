//! What the panel reads and changes.

use bevy::{ecs::system::SystemParam, prelude::*};

use plenoctree::PlenOctree;

use crate::{
    palette::{FieldPalette, PaletteExtraction, PaletteOverride, Palettes},
    posterize::Posterize,
    prop::Prop,
};

/// What [`palette_ui`](super::palette_ui) reads and changes: a parameter of the system that calls it.
#[derive(SystemParam)]
pub struct PaletteEditor<'w, 's> {
    pub(super) commands: Commands<'w, 's>,
    pub(super) palettes: ResMut<'w, Palettes>,
    pub(super) extraction: ResMut<'w, PaletteExtraction>,
    pub(super) fields: Res<'w, Assets<PlenOctree>>,
    pub(super) server: Option<Res<'w, AssetServer>>,
    props: Query<'w, 's, PropData>,
}

type PropData =
    (&'static Prop, Option<&'static mut Posterize>, Option<&'static PutAside>, Option<&'static mut PaletteOverride>);

/// The settings of a prop that is shown as trained at the moment, for when it is posterized again.
#[derive(Component)]
struct PutAside(Posterize);

impl PaletteEditor<'_, '_> {
    /// Whether `prop` is posterized.
    pub fn is_posterized(&self, prop: Entity) -> bool {
        matches!(self.props.get(prop), Ok((_, Some(_), ..)))
    }

    /// Adds or removes the [`Posterize`] of `prop`. When it is added again, it has the settings that it had.
    pub fn set_posterized(&mut self, prop: Entity, posterized: bool) {
        let Ok((_, settings, aside, _)) = self.props.get(prop) else {
            return;
        };
        let mut prop = self.commands.entity(prop);
        match (settings, posterized) {
            (None, true) => {
                let settings = aside.map(|aside| aside.0).unwrap_or_default();
                prop.try_insert(settings).try_remove::<PutAside>();
            }
            (Some(settings), false) => {
                prop.try_insert(PutAside(*settings)).try_remove::<Posterize>();
            }
            _ => {}
        }
    }

    /// The field that `prop` shows.
    pub(super) fn field(&self, prop: Entity) -> Option<AssetId<PlenOctree>> {
        self.props.get(prop).ok().map(|(Prop(field), ..)| field.id())
    }

    /// The [`Posterize`] that `prop` has, or would have.
    pub(super) fn posterize(&self, prop: Entity) -> Posterize {
        match self.props.get(prop) {
            Ok((_, Some(settings), ..)) => *settings,
            Ok((_, _, Some(aside), _)) => aside.0,
            _ => Posterize::default(),
        }
    }

    /// Changes the [`Posterize`] of `prop`, if it is posterized.
    pub(super) fn set_posterize(&mut self, prop: Entity, new: Posterize) {
        if let Ok((_, Some(mut settings), ..)) = self.props.get_mut(prop) {
            *settings = new;
        }
    }

    /// The colors that `prop` shows in place of its field's.
    pub(super) fn own_colors(&self, prop: Entity) -> Option<&PaletteOverride> {
        self.props.get(prop).ok().and_then(|(.., own)| own)
    }

    /// Adds or removes the [`PaletteOverride`] of `prop`.
    pub(super) fn set_own_colors(&mut self, prop: Entity, own: bool) {
        let mut prop = self.commands.entity(prop);
        if own {
            prop.try_insert(PaletteOverride::default());
        } else {
            prop.try_remove::<PaletteOverride>();
        }
    }

    /// Changes the prop's own colors if it has some, else those of its field.
    pub(super) fn recolor(&mut self, prop: Entity, field: AssetId<PlenOctree>, edit: Edit) {
        if let Ok((.., Some(mut own))) = self.props.get_mut(prop) {
            match edit {
                Edit::Set(index, color) => own.set(index, color),
                Edit::Reset(index) => own.unset(index),
                Edit::ResetAll => own.reset(),
            }
        } else if let Some(palette) = self.palettes.get_mut(field) {
            match edit {
                Edit::Set(index, color) => palette.set(index, color),
                Edit::Reset(index) => palette.set(index, source_color(palette, index)),
                Edit::ResetAll => palette.reset(),
            }
        }
    }
}

/// What the user does to the shown colors.
pub(super) enum Edit {
    Set(usize, Color),
    Reset(usize),
    ResetAll,
}

/// An extracted color; black if there is no such.
pub(super) fn source_color(palette: &FieldPalette, index: usize) -> Color {
    palette.source().colors.get(index).map_or(Color::BLACK, |c| Color::srgb(c[0] as f32, c[1] as f32, c[2] as f32))
}
