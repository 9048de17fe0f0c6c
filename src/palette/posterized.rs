//! Finding the fields that need a palette.

use bevy::{ecs::system::SystemParam, prelude::*};
use plenoctree::PlenOctree;

use crate::{posterize::Posterize, prop::Prop, stage::PosterizeView};

/// A system parameter that queries everything that needs a palette: posterized props and posterized views.
#[derive(SystemParam)]
pub(super) struct Posterized<'w, 's> {
    props: Query<'w, 's, &'static Prop, With<Posterize>>,
    views: Query<'w, 's, &'static PosterizeView, With<Posterize>>,
}

impl Posterized<'_, '_> {
    /// Returns the fields of posterized props and views. A field can occur more than once.
    pub fn fields(&self) -> impl Iterator<Item = AssetId<PlenOctree>> {
        self.props.iter().map(|prop| prop.0.id()).chain(self.views.iter().map(|view| view.0.id()))
    }
}
