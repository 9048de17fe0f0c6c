//! Finds out whether props can be drawn, and what they wait for.

mod drawn;
mod ready;
mod update;

pub(crate) use drawn::DrawnOverride;
pub use ready::{props_progress, props_ready};

use bevy::prelude::*;

use crate::{
    asset::FilesRead,
    prop::{PropProgress, PropState},
    sets::PlenOctreeSystems,
};

/// Keeps [`PropState`] up to date.
pub(crate) struct PropStatePlugin;

impl Plugin for PropStatePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<PropState>()
            .register_type::<PropProgress>()
            .init_resource::<FilesRead>()
            .configure_sets(PreUpdate, PlenOctreeSystems::UpdateProps.after(PlenOctreeSystems::UpdatePalettes))
            .add_systems(PreUpdate, update::update.in_set(PlenOctreeSystems::UpdateProps));
    }
}
