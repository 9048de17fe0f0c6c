//! The system parameter that the panel reads from and writes to.

use bevy::{ecs::system::SystemParam, prelude::*};

use plenoctree::{PlenOctree, palette::RampAdjustment};

use crate::{
    camera::PosterizeView,
    palette::{FieldPalette, PaletteExtraction, PaletteOverride, Palettes},
    posterize::Posterize,
    prop::Prop,
};

/// A system parameter with everything that [`palette_ui`](super::palette_ui) reads and writes.
#[derive(SystemParam)]
pub struct PaletteEditor<'w, 's> {
    pub(super) commands: Commands<'w, 's>,
    pub(super) palettes: ResMut<'w, Palettes>,
    pub(super) extraction: ResMut<'w, PaletteExtraction>,
    pub(super) fields: Res<'w, Assets<PlenOctree>>,
    pub(super) server: Option<Res<'w, AssetServer>>,
    props: Query<'w, 's, PropData>,
    views: Query<'w, 's, (&'static PosterizeView, &'static mut PaletteOverride), Without<Prop>>,
}

type PropData = (
    &'static Prop,
    Option<&'static mut Posterize>,
    Option<&'static Stashed<Posterize>>,
    Option<&'static mut Stashed<PaletteOverride>>,
    Option<&'static mut PaletteOverride>,
);

/// A component that was removed from a prop, to restore when it is added again, and the field that the prop had.
#[derive(Component)]
struct Stashed<C: Component>(C, AssetId<PlenOctree>);

/// Adds or removes a component. If this removed it, adding it restores it.
fn toggle<C: Component + Clone + Default>(
    prop: &mut EntityCommands,
    field: AssetId<PlenOctree>,
    current: Option<&C>,
    stashed: Option<&Stashed<C>>,
    wanted: bool,
) {
    match (current, wanted) {
        (None, true) => {
            let restored = stashed.map(|stashed| stashed.0.clone()).unwrap_or_default();
            prop.try_insert(restored).try_remove::<Stashed<C>>();
        }
        (Some(current), false) => {
            prop.try_insert(Stashed(current.clone(), field)).try_remove::<C>();
        }
        _ => {}
    }
}

impl PaletteEditor<'_, '_> {
    /// Returns whether `prop` is posterized.
    pub fn is_posterized(&self, prop: Entity) -> bool {
        matches!(self.props.get(prop), Ok((_, Some(_), ..)))
    }

    /// Adds or removes the [`Posterize`] of `prop`. If it was removed by this function, adding it restores its
    /// settings.
    ///
    /// Does nothing if the entity is not a [`Prop`].
    pub fn set_posterized(&mut self, prop: Entity, posterized: bool) {
        if let Ok((Prop(field), settings, stashed, ..)) = self.props.get(prop) {
            toggle(&mut self.commands.entity(prop), field.id(), settings, stashed, posterized);
        }
    }

    /// Returns the field of `prop`, or `None` if the entity is not a prop.
    pub(super) fn field(&self, prop: Entity) -> Option<AssetId<PlenOctree>> {
        self.props.get(prop).ok().map(|(Prop(field), ..)| field.id())
    }

    /// Returns the [`Posterize`] of `prop` or, if it is not posterized, the one that it would be given.
    pub(super) fn posterize(&self, prop: Entity) -> Posterize {
        match self.props.get(prop) {
            Ok((_, Some(settings), ..)) => *settings,
            Ok((_, _, Some(stashed), ..)) => stashed.0,
            _ => Posterize::default(),
        }
    }

    /// Sets the [`Posterize`] of `prop`, if it is posterized.
    pub(super) fn set_posterize(&mut self, prop: Entity, new: Posterize) {
        if let Ok((_, Some(mut settings), ..)) = self.props.get_mut(prop) {
            *settings = new;
        }
    }

    /// Returns the [`PaletteOverride`] of `prop`, if it has one.
    pub(super) fn own_colors(&self, prop: Entity) -> Option<&PaletteOverride> {
        self.props.get(prop).ok().and_then(|(.., own)| own)
    }

    /// Adds or removes the [`PaletteOverride`] of `prop`. If it was removed by this function, adding it restores it,
    /// unless the prop has another field.
    pub(super) fn set_own_colors(&mut self, prop: Entity, own: bool) {
        if let Ok((Prop(field), .., stashed, colors)) = self.props.get(prop) {
            let stashed = stashed.filter(|stashed| stashed.1 == field.id());
            toggle(&mut self.commands.entity(prop), field.id(), colors, stashed, own);
        }
    }

    /// Edits the [`PaletteOverride`] of `prop` or, if it has none, the shown colors of its field. Ramps are edited in
    /// the field's palette.
    pub(super) fn edit(&mut self, prop: Entity, field: AssetId<PlenOctree>, edit: Edit) {
        let own = self.props.get_mut(prop).ok().and_then(|(.., own)| own);
        if let (Edit::Colors(edit), Some(mut own)) = (&edit, own) {
            if let Some(palette) = self.palettes.get(field) {
                recolor_own(&mut own, palette, *edit);
            }
            return;
        }
        let Some(palette) = self.palettes.get_mut(field) else { return };
        // An edit of the user's that ramps cannot take, such as a name that another one has, changes nothing.
        match edit {
            Edit::Colors(edit) => recolor_field(palette, edit),
            Edit::Rename(ramp, new) => {
                let Some(old) = palette.ramps().get(ramp).map(|ramp| ramp.name.clone()) else { return };
                if palette.edit_ramps(|palette| palette.rename_ramp(ramp, new.clone())).is_ok() {
                    self.rename_in_overrides(field, &old, &new);
                }
            }
            Edit::Move(tone, ramp) => _ = palette.edit_ramps(|palette| palette.move_tone(tone, ramp)),
        }
    }

    /// Lets the overrides of all props and posterized views of a field follow the new name of a ramp.
    fn rename_in_overrides(&mut self, field: AssetId<PlenOctree>, old: &str, new: &str) {
        let rename = |mut own: Mut<PaletteOverride>| {
            if own.bypass_change_detection().rename_ramp(old, new) {
                own.set_changed();
            }
        };
        for (prop, .., stashed, own) in &mut self.props {
            if let Some(mut stashed) = stashed.filter(|stashed| stashed.1 == field) {
                stashed.0.rename_ramp(old, new);
            }
            if let Some(own) = own.filter(|_| prop.0.id() == field) {
                rename(own);
            }
        }
        let views = self.views.iter_mut().filter(|(view, _)| view.0.id() == field);
        views.for_each(|(_, own)| rename(own));
    }
}

fn recolor_own(own: &mut PaletteOverride, palette: &FieldPalette, edit: ColorEdit) {
    match edit {
        ColorEdit::Set(index, color) => _ = own.set(index, color),
        ColorEdit::Reset(index) => own.unset(index),
        ColorEdit::ResetAll => own.reset(),
        ColorEdit::SetRamp(ramp, _) | ColorEdit::ResetRamp(ramp) => {
            if let Some(ramp) = palette.ramps().get(ramp) {
                ramp.tones.iter().for_each(|tone| own.unset(*tone));
                match edit {
                    ColorEdit::SetRamp(_, color) => own.set_ramp(&ramp.name, color),
                    _ => own.unset_ramp(&ramp.name),
                }
            }
        }
    }
}

fn recolor_field(palette: &mut FieldPalette, edit: ColorEdit) {
    match edit {
        ColorEdit::Set(index, color) => _ = palette.set(index, color),
        ColorEdit::Reset(index) => _ = palette.set(index, source_color(palette, index)),
        ColorEdit::ResetAll => palette.reset(),
        ColorEdit::SetRamp(ramp, color) => _ = palette.set_ramp(ramp, color),
        ColorEdit::ResetRamp(ramp) => _ = palette.adjust_ramp(ramp, &RampAdjustment::default()),
    }
}

/// An edit by the user.
pub(super) enum Edit {
    Colors(ColorEdit),
    /// Renames a ramp.
    Rename(usize, String),
    /// Moves a tone to a ramp.
    Move(usize, usize),
}

/// An edit of shown colors.
#[derive(Clone, Copy)]
pub(super) enum ColorEdit {
    Set(usize, Color),
    Reset(usize),
    ResetAll,
    SetRamp(usize, Color),
    ResetRamp(usize),
}

impl From<ColorEdit> for Edit {
    fn from(edit: ColorEdit) -> Self {
        Self::Colors(edit)
    }
}

/// Returns a source color, or black if the palette has no color of that index.
pub(super) fn source_color(palette: &FieldPalette, index: usize) -> Color {
    palette.source().nth(index).unwrap_or(Color::BLACK)
}
