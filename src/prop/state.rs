//! The states of props.

use bevy::{asset::AssetLoadError, prelude::*};
use plenoctree::palette::ExtractionError;

use crate::gpu::FieldTooLarge;

/// Whether a [`Prop`](crate::Prop) can be drawn, and if not, what it waits for.
///
/// Every prop has this component; do not change it. It is updated in [`PreUpdate`], in
/// [`PlenOctreeSystems::UpdateProps`](crate::PlenOctreeSystems::UpdateProps), and marked as changed only when it
/// changes. It does not matter whether a prop is in view: props that no camera sees become ready as well. Saved worlds
/// do not contain it.
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
///     info!("all props are ready");
/// }
///
/// fn plugin(app: &mut App) {
///     app.add_systems(Update, (report, start_game.run_if(props_ready).run_if(run_once)));
/// }
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin, plugin)).update();
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub enum PropState {
    /// The field is not loaded yet. This is the default.
    #[default]
    Loading,
    /// The field is loaded, but has not arrived on the GPU yet. If it was reloaded, its earlier version is drawn in the
    /// meantime.
    Uploading,
    /// The palette is being loaded or extracted. Only props with a [`Posterize`](crate::Posterize) or a
    /// [`Recolor`](crate::Recolor) wait for one; [`PaletteExtraction::progress`](crate::PaletteExtraction::progress)
    /// returns its progress.
    AwaitingPalette,
    /// All data is available, but Bevy has not yet compiled the pipelines of the cameras that see the prop, for the
    /// first time.
    Compiling,
    /// The prop is drawn wherever a camera sees it. It stays ready if cameras need other pipelines later: if their
    /// [`Msaa`] or format changes, props may be missing for the frames in which these are compiled.
    Ready,
    /// The prop cannot be drawn as it should be. Waiting does not help, unless memory becomes free
    /// ([`PropError::TooLarge`]).
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
    /// The field could not be loaded. Holds the first line of the loader's message. The prop is not drawn, or if it had
    /// another field before, that one still is.
    #[error("{0}")]
    Load(String),
    /// The GPU cannot hold the field. The prop is not drawn. If its field was reloaded or replaced, the earlier one is
    /// still drawn. If memory ran out, the prop is drawn once there is enough: see
    /// [`FieldFailed`](crate::FieldFailed).
    #[error(transparent)]
    TooLarge(FieldTooLarge),
    /// No palette could be extracted. The prop is drawn as trained.
    #[error("no palette could be extracted: {0}")]
    Palette(ExtractionError),
    /// A pipeline that draws props could not be created. No prop is drawn, or none is posterized.
    #[error("a pipeline that draws props could not be created: {0}")]
    Pipeline(String),
}

impl PropError {
    /// Returns the error of a loader without the backtrace that Bevy adds to it.
    pub(crate) fn of_loader(error: &AssetLoadError) -> Self {
        let text = error.to_string();
        Self::Load(text.lines().next().unwrap_or_default().to_string())
    }
}
