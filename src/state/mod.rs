//! Whether props can be drawn, and what they wait for.

mod drawn;
mod progress;
mod update;

pub use progress::PropProgress;

pub(crate) use drawn::{DrawnField, is_held_back};

use bevy::prelude::*;
use plenoctree::palette::ExtractionError;

use crate::{asset::FilesRead, gpu::FieldTooLarge, prop::Prop, sets::PlenOctreeSystems};

/// Whether a [`Prop`](crate::Prop) can be drawn, and if not, what it waits for.
///
/// Every prop has this component; do not change it. It is updated in [`PreUpdate`], in
/// [`PlenOctreeSystems::UpdateProps`](crate::PlenOctreeSystems::UpdateProps), and marked as changed only when it
/// changes. Where a prop is in view does not matter: props that no camera sees become ready as well.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, Prop, PropState, props_ready};
/// // Reports props that will never be drawn as they should be.
/// fn report(props: Query<(&Name, &PropState), Changed<PropState>>) {
///     for (name, state) in &props {
///         if let PropState::Failed(error) = state {
///             error!("{name}: {error}");
///         }
///     }
/// }
///
/// fn start_game() {
///     info!("all props are there");
/// }
///
/// fn plugin(app: &mut App) {
///     app.add_systems(Update, (report, start_game.run_if(props_ready).run_if(run_once)));
/// }
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin, plugin)).update();
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub enum PropState {
    /// The field is not loaded yet. This is the default.
    #[default]
    Loading,
    /// The field is loaded, but has not arrived on the GPU yet. If it was reloaded, its earlier version is drawn meanwhile.
    Uploading,
    /// The palette is being loaded or extracted. Only posterized props wait for one;
    /// [`PaletteExtraction::progress`](crate::PaletteExtraction::progress) returns how far its extraction is.
    AwaitingPalette,
    /// All data is there, but Bevy has not compiled the pipelines of the cameras that see the prop yet.
    Compiling,
    /// The prop is drawn wherever a camera sees it.
    Ready,
    /// The prop cannot be drawn as it should be. Waiting does not help.
    Failed(PropError),
}

impl PropState {
    /// Returns whether the prop can be drawn.
    pub fn is_ready(&self) -> bool {
        *self == Self::Ready
    }

    /// Returns whether the prop is neither ready nor failed.
    pub fn is_waiting(&self) -> bool {
        !matches!(self, Self::Ready | Self::Failed(_))
    }
}

/// The reason why a prop cannot be drawn as it should be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PropError {
    /// The field could not be loaded. Holds the loader's message. The prop is not drawn.
    #[error("{0}")]
    Load(String),
    /// The GPU cannot hold the field. The prop is not drawn. If its field was reloaded, the earlier version is drawn.
    #[error(transparent)]
    TooLarge(FieldTooLarge),
    /// No palette could be extracted. The prop is drawn as trained.
    #[error("no palette could be extracted: {0}")]
    Palette(ExtractionError),
    /// A pipeline that draws props could not be created. No prop is drawn, or none is posterized.
    #[error("a pipeline that draws props could not be created: {0}")]
    Pipeline(String),
}

/// A run condition: returns whether no prop is waiting for its field, its palette or its pipelines.
///
/// Props that have [failed](PropState::Failed) do not count, because they would never let a loading screen end. Returns
/// true if there are no props. A prop that was spawned in this frame is waiting, even if its field is on the GPU.
pub fn props_ready(props: Query<&PropState, With<Prop>>) -> bool {
    !props.iter().any(PropState::is_waiting)
}

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
