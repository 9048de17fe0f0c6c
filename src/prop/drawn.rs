//! Which field of a prop is drawn.

use bevy::prelude::*;
use plenoctree::PlenOctree;

/// The last field of a prop that could be drawn. If the prop is given another one, this one is drawn until the other
/// can be.
#[derive(Component, Clone, Default)]
pub(crate) struct DrawnField {
    pub(crate) field: Option<Handle<PlenOctree>>,
    /// The frame in which everything that the field needs became available.
    pub(crate) since: u64,
}

impl DrawnField {
    /// Returns the field to draw while the prop's own cannot be drawn, if it is a different one.
    pub fn stand_in(&self, own: &Handle<PlenOctree>) -> Option<&Handle<PlenOctree>> {
        self.field.as_ref().filter(|field| *field != own)
    }
}
