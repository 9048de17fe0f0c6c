//! System sets, for ordering your own systems relative to the plugin's.

use bevy::prelude::*;

use crate::camera::PropPlacement;

/// The plugin's system sets in the main world.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlenOctreeSystems {
    /// Writes [`FieldReady`](crate::FieldReady), [`FieldFailed`](crate::FieldFailed) and
    /// [`ViewFailed`](crate::ViewFailed). Runs in [`PreUpdate`].
    ReportFields,
    /// Loads palettes, starts and finishes extractions, and writes [`PaletteReady`](crate::PaletteReady) and
    /// [`PaletteFailed`](crate::PaletteFailed). Runs in [`PreUpdate`], after [`Self::ReportFields`], so systems in
    /// [`Update`] can edit a new palette before it is first shown.
    UpdatePalettes,
    /// Updates the [`PropState`](crate::PropState) of props. Runs in [`PreUpdate`], after [`Self::UpdatePalettes`].
    UpdateProps,
    /// Updates the [`Aabb`] of props from the bounds of their fields. Runs in [`PostUpdate`], within
    /// [`VisibilitySystems::CalculateBounds`].
    ///
    /// [`Aabb`]: bevy::camera::primitives::Aabb
    /// [`VisibilitySystems::CalculateBounds`]: bevy::camera::visibility::VisibilitySystems::CalculateBounds
    UpdateBounds,
}

/// The plugin's system sets in the render world, in the order in which they run.
///
/// The first three run in the [`Render`] schedule, once for all views. The others run in the [`Core3d`] schedule, once
/// per view. Sets with a [`PropPlacement`] exist once per placement; their systems do nothing in views with the other
/// placement.
///
/// [`Render`]: bevy::render::Render
/// [`Core3d`]: bevy::core_pipeline::schedule::Core3d
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlenOctreeRenderSystems {
    /// Chooses and requests the level of each prop in each view.
    ChooseLevels,
    /// Uploads fields and requested levels that were made in the background, as far as the
    /// [`UploadBudget`](crate::UploadBudget) allows.
    UploadLevels,
    /// Plans the frame of each view, and prepares what its passes need.
    PlanViews,
    /// Draws the props into the view's layer, and finds how much light falls on them. In views of several props, or at
    /// [`PropPlacement::Display`], also finds how much of the pixels at their edges posterized props cover.
    Layer,
    /// Blends the layer over the scene, finds how much of the pixels at the edges of a single prop it covers, filters,
    /// assigns labels, smooths borders and edges, draws ink, and runs custom stages.
    Posterize(PropPlacement),
    /// Fades props in fog, and writes the result to the view's target, and the depth of props where they are solid.
    Present(PropPlacement),
    /// Draws transparent objects again, over props at [`PropPlacement::Display`].
    Objects,
}
