//! The panel's contents, and what they read and change.

use bevy::{asset::LoadState, ecs::system::SystemParam, prelude::*};
use bevy_egui::egui;

use super::{
    extraction, look,
    swatches::{self, Edit},
};
use crate::{
    field::PlenOctree,
    palettes::{PaletteExtraction, PaletteOverride, Palettes},
    prop::{Posterize, Prop},
};

/// What [`palette_ui`] reads and changes: a parameter of the system that calls it.
#[derive(SystemParam)]
pub struct PaletteEditor<'w, 's> {
    pub(super) commands: Commands<'w, 's>,
    pub(super) palettes: ResMut<'w, Palettes>,
    pub(super) extraction: ResMut<'w, PaletteExtraction>,
    pub(super) fields: Res<'w, Assets<PlenOctree>>,
    server: Option<Res<'w, AssetServer>>,
    props: Query<'w, 's, PropData>,
}

type PropData =
    (&'static Prop, Option<&'static mut Posterize>, Option<&'static PutAside>, Option<&'static mut PaletteOverride>);

/// The look of a prop that is shown as trained at the moment, for when it is posterized again.
#[derive(Component)]
struct PutAside(Posterize);

impl PaletteEditor<'_, '_> {
    /// Whether `prop` is posterized.
    pub fn is_posterized(&self, prop: Entity) -> bool {
        matches!(self.props.get(prop), Ok((_, Some(_), ..)))
    }

    /// Adds or removes the [`Posterize`] of `prop`. A look that is removed comes back with its settings.
    pub fn set_posterized(&mut self, prop: Entity, posterized: bool) {
        let Ok((_, look, aside, _)) = self.props.get(prop) else {
            return;
        };
        let mut prop = self.commands.entity(prop);
        match (look, posterized) {
            (None, true) => {
                let look = aside.map(|aside| aside.0).unwrap_or_default();
                prop.try_insert(look).try_remove::<PutAside>();
            }
            (Some(look), false) => {
                prop.try_insert(PutAside(*look)).try_remove::<Posterize>();
            }
            _ => {}
        }
    }

    /// The field that `prop` shows.
    fn field(&self, prop: Entity) -> Option<AssetId<PlenOctree>> {
        self.props.get(prop).ok().map(|(Prop(field), ..)| field.id())
    }

    /// The look that `prop` has, or would have.
    pub(super) fn look(&self, prop: Entity) -> Posterize {
        match self.props.get(prop) {
            Ok((_, Some(look), ..)) => *look,
            Ok((_, _, Some(aside), _)) => aside.0,
            _ => Posterize::default(),
        }
    }

    /// Changes the look of `prop`, if it is posterized.
    pub(super) fn set_look(&mut self, prop: Entity, new: Posterize) {
        if let Ok((_, Some(mut look), ..)) = self.props.get_mut(prop) {
            *look = new;
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
                Edit::Reset(index) => palette.set(index, swatches::extracted(palette, index)),
                Edit::ResetAll => palette.reset(),
            }
        }
    }
}

/// The palette and the look of the entity `prop`: swatches, settings, extraction.
///
/// Nothing is marked as changed unless the user changes it.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_egui::{EguiContexts, egui};
/// # use bevy_plenoctree::{Prop, panel::{PaletteEditor, palette_ui}};
/// // A system of `EguiPrimaryContextPass`.
/// fn my_tools(mut contexts: EguiContexts, mut editor: PaletteEditor, prop: Single<Entity, With<Prop>>) -> Result {
///     egui::Window::new("My tools").show(contexts.ctx_mut()?, |ui| palette_ui(ui, *prop, &mut editor));
///     Ok(())
/// }
/// ```
pub fn palette_ui(ui: &mut egui::Ui, prop: Entity, editor: &mut PaletteEditor) {
    let Some(field) = editor.field(prop) else {
        ui.weak("This entity is no prop.");
        return;
    };
    ui.push_id(prop, |ui| {
        if !editor.fields.contains(field) {
            loading(ui, field, editor);
            return;
        }
        swatches::show(ui, prop, field, editor);
        ui.separator();
        look::show(ui, prop, editor);
        ui.separator();
        extraction::show(ui, field, editor);
    });
}

fn loading(ui: &mut egui::Ui, field: AssetId<PlenOctree>, editor: &PaletteEditor) {
    match editor.server.as_ref().and_then(|server| server.get_load_state(field)) {
        Some(LoadState::Failed(error)) => {
            ui.colored_label(ui.visuals().error_fg_color, error.to_string());
        }
        Some(LoadState::Loading) => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label("Loading");
            });
        }
        _ => {
            ui.weak("The prop's field is not loaded.");
        }
    }
}
