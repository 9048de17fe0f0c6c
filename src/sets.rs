//! System sets: where to order systems of your own against the plugin's.

use bevy::prelude::*;

use crate::stage::PropStage;

/// What the plugin does in the main world, frame by frame.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlenOctreeSystems {
    /// In [`PreUpdate`]: writes [`FieldReady`](crate::FieldReady) and [`FieldFailed`](crate::FieldFailed).
    ReportFields,
    /// In [`PreUpdate`], after [`Self::ReportFields`]: reads palettes, starts and finishes extractions, and writes
    /// [`PaletteReady`](crate::PaletteReady). Systems in [`Update`] can change a new palette before it is first shown.
    UpdatePalettes,
    /// In [`PostUpdate`], within [`VisibilitySystems::CalculateBounds`]: gives props the bounds of their fields.
    ///
    /// [`VisibilitySystems::CalculateBounds`]: bevy::camera::visibility::VisibilitySystems::CalculateBounds
    UpdateBounds,
}

/// What the plugin does in the render world, in this order.
///
/// The first five run in the [`Render`] schedule for all views at once, the others in the [`Core3d`] schedule for one
/// view at a time. Those with a [`PropStage`] exist once for each place in the frame, and do nothing in views whose props
/// are drawn at the other one.
///
/// [`Render`]: bevy::render::Render
/// [`Core3d`]: bevy::core_pipeline::schedule::Core3d
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlenOctreeRenderSystems {
    /// Chooses the level of detail of every prop in every view.
    ChooseLevels,
    /// Uploads the levels that were made in the background, and drops those that no view asks for.
    UploadLevels,
    /// Writes the views' uniforms and creates their textures.
    PrepareViews,
    /// Creates the pipelines of all passes.
    PreparePipelines,
    /// Creates the bind groups of all passes.
    PrepareBindGroups,
    /// Draws the props into the view's layer.
    Volume,
    /// Brings a layer of a lower resolution to that of the viewport.
    Upsample,
    /// Blends the layer over the scene, filters it, and assigns labels. Writes the view's target, or, for cameras with
    /// [`LabelStages`](crate::LabelStages), the textures that custom stages work on.
    Posterize(PropStage),
    /// Empty: add custom stages here. They run in views that have [`LabelTextures`](crate::LabelTextures).
    LabelStages(PropStage),
    /// Writes what custom stages made to the view's target.
    Present(PropStage),
    /// Writes the props' depth where they are solid.
    Depth(PropStage),
}
