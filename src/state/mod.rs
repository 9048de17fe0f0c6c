//! Whether props can be drawn, and what they wait for.

mod drawn;
mod progress;
mod prop_state;
mod ready;
mod update;

pub(crate) use drawn::DrawnField;
pub use progress::PropProgress;
pub use prop_state::{PropError, PropState};
pub use ready::props_ready;

use bevy::prelude::*;

use crate::{asset::FilesRead, sets::PlenOctreeSystems};

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
