//! Finding the fields that need a palette.

use bevy::{ecs::system::SystemParam, prelude::*};
use plenoctree::{PlenOctree, palette::PaletteMethod};

use crate::{camera::PosterizeView, posterize::Posterize, prop::Prop, recolor::Recolor};

/// A system parameter that queries everything that needs a palette: posterized props, recolored ones, and posterized
/// views.
#[derive(SystemParam)]
pub(super) struct Posterized<'w, 's> {
    props: Query<'w, 's, (&'static Prop, Option<&'static Posterize>), Or<(With<Posterize>, With<Recolor>)>>,
    views: Query<'w, 's, (&'static PosterizeView, &'static Posterize)>,
}

impl Posterized<'_, '_> {
    /// Returns the fields of these props and views. A field can occur more than once.
    pub fn fields(&self) -> impl Iterator<Item = AssetId<PlenOctree>> {
        self.methods().map(|(field, _)| field)
    }

    /// Returns these fields, and the method of the palette that is wanted.
    pub fn methods(&self) -> impl Iterator<Item = (AssetId<PlenOctree>, Option<PaletteMethod>)> {
        let props = self.props.iter().map(|(prop, posterize)| (prop.0.id(), posterize.and_then(|of| of.method)));
        props.chain(self.views.iter().map(|(view, posterize)| (view.0.id(), posterize.method)))
    }

    /// Returns whether there are such props or views of a field, and all of them want a palette of another method.
    pub fn reject(&self, field: AssetId<PlenOctree>, method: PaletteMethod) -> bool {
        let mut wanted = self.methods().filter(|(of, _)| *of == field).map(|(_, wanted)| wanted).peekable();
        wanted.peek().is_some() && wanted.all(|wanted| wanted.is_some_and(|wanted| wanted != method))
    }
}
