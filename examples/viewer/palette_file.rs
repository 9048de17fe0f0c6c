//! Saves and loads palettes.

use std::path::{Path, PathBuf};

use bevy::{math::DVec3, prelude::*};
use bevy_plenoctree::{FieldPalette, Palette, PaletteOverride, Palettes, PlenOctree, Prop};

use crate::{
    action::{Action, Colors},
    notices::Notices,
};

/// Returns the file next to a field from which games load its palette.
pub fn palette_beside(field: &Path) -> PathBuf {
    field.with_extension("palette.json")
}

/// Returns the file for the colors that the prop shows. Unlike the other one, games do not load it by themselves.
pub fn shown_beside(field: &Path) -> PathBuf {
    field.with_extension("shown.palette.json")
}

/// Saves and loads colors when the user requests it.
pub fn transfer(
    mut actions: MessageReader<Action>,
    mut palettes: ResMut<Palettes>,
    mut notices: ResMut<Notices>,
    mut props: Query<(&Prop, Option<&mut PaletteOverride>)>,
) {
    for action in actions.read() {
        let prop = props.iter_mut().next().ok_or("No field is loaded yet.".to_string());
        let (path, result) = match action {
            Action::Save(path, colors) => {
                (path, prop.and_then(|(Prop(field), own)| save(path, *colors, palettes.get(field), own.as_deref())))
            }
            Action::Load(path, colors) => {
                (path, prop.and_then(|(Prop(field), own)| load(path, *colors, field.id(), &mut palettes, own)))
            }
            _ => continue,
        };
        match result {
            Ok(what) => notices.info(format!("{what}: {}", path.display())),
            Err(error) => notices.error(error),
        }
    }
}

/// Returns a message that says what was done.
fn save(
    path: &Path,
    colors: Colors,
    palette: Option<&FieldPalette>,
    own: Option<&PaletteOverride>,
) -> Result<&'static str, String> {
    let mut saved = palette.ok_or("There is no palette to save yet.")?.clone();
    let what = match colors {
        // Overrides belong to the prop.
        Colors::Source => "Saved the palette",
        Colors::Shown | Colors::Either => {
            if let Some(own) = own {
                saved.show(own.shown(&saved));
            }
            "Saved the shown colors"
        }
    };
    saved.save(path).map_err(|error| error.to_string())?;
    Ok(what)
}

/// Returns a message that says what was done.
fn load(
    path: &Path,
    colors: Colors,
    field: AssetId<PlenOctree>,
    palettes: &mut Palettes,
    own: Option<Mut<PaletteOverride>>,
) -> Result<&'static str, String> {
    let read = Palette::read(path).map_err(|error| error.to_string())?;
    let found = read.colors.len();
    let fitting = palettes.get(field).is_some_and(|palette| palette.shown().len() == found);
    match (colors, palettes.get_mut(field)) {
        (Colors::Shown | Colors::Either, Some(palette)) if fitting => {
            let shown = read.shown_colors().iter().map(|color| Srgba::from_vec3(DVec3::from(*color).as_vec3()));
            match own {
                Some(mut own) => shown.enumerate().for_each(|(index, color)| _ = own.set(index, color)),
                None => palette.show(shown),
            }
            Ok("Loaded the shown colors")
        }
        (Colors::Shown, Some(palette)) => {
            let (path, expected) = (path.display(), palette.shown().len());
            Err(format!("palette {path}: found {found} colors, expected {expected}, one for each source color"))
        }
        (Colors::Shown, None) => Err("There is no palette yet whose shown colors could be loaded.".into()),
        (Colors::Source | Colors::Either, _) => {
            palettes.insert(field, FieldPalette::new(read));
            Ok("Loaded a new palette")
        }
    }
}
