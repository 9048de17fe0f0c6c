//! The plan of a view's frame: everything that is decided, in one place. Passes read it and decide nothing.

mod decide;
mod levels;
mod motion;
mod overlap;
mod steady;
mod systems;
mod uniforms;
mod view;

#[cfg(feature = "shadows")]
pub(super) use decide::{covered, extent};
#[cfg(feature = "shadows")]
pub(super) use levels::levels_coarser;
#[cfg(feature = "shadows")]
pub(super) use systems::InitPlans;
pub(super) use systems::plugin;
pub(super) use uniforms::{FilterUniform, LabelsUniform, PropUniform, ScreenUniform, Smooths, ViewUniform};
pub(crate) use view::PropView;
pub(super) use view::{Overlap, Plan, PlannedProp};

use bevy::{
    camera::{MainPassResolutionOverride, Viewport},
    prelude::*,
    render::camera::ExtractedCamera,
};

/// Returns the part of a view's target that its main pass draws to, in pixels, or `None` if it is empty.
pub(super) fn drawn_viewport(
    camera: &ExtractedCamera,
    resolution: Option<&MainPassResolutionOverride>,
) -> Option<Viewport> {
    let viewport = camera.viewport.clone().or_else(|| {
        let physical_size = camera.physical_viewport_size?;
        Some(Viewport { physical_size, ..default() })
    });
    Viewport::from_viewport_and_override(viewport.as_ref(), resolution)
        .filter(|viewport| viewport.physical_size.min_element() > 0)
}
