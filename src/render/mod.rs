//! Draws props, in the `Core3d` schedule.
//!
//! There is one module per pass. In the order of a frame:
//!
//! - `shadow` draws the props into the shadow maps of lights, before the main pass (feature `shadows`).
//! - `kept` finds what is still valid from the previous frame, so that the passes up to `blend` need not run.
//! - `solid` finds the nearest solid part of any prop, in views where props overlap.
//! - `volume` draws the props into the view's layer.
//! - `refine` interpolates pixels where rays agree, and draws the others, in views that do not cast a ray for every
//!   pixel.
//! - `edges` finds how much of the pixels at their edges posterized props cover.
//! - `lighting` finds how much of the scene's light is blocked on its way to props (feature `shadows`).
//! - `composite` blends the layer over the scene, if anything is posterized.
//! - `filter` flattens the colors.
//! - `label` replaces them by palette colors. If nothing is posterized, it blends the layer over the scene itself.
//! - `blend` smooths the edges of posterized props.
//! - `present` writes the result, or that of custom stages, to the view's target.
//! - `depth` writes depth where props are solid.
//! - `prepass` writes their depth and motion into the textures of Bevy's prepass, for effects that read it.
//! - `transparent` draws transparent objects over props that are drawn after them.
//!
//! `solid`, `volume`, `refine` and `edges` run after the opaque main pass and the sky, and before objects that transmit
//! light. The other passes run right after them, or after all post-processing, depending on [`PropStage`].

mod attachment;
mod bind_group;
mod blend;
mod boxes;
mod composite;
mod depth;
mod edges;
mod extract;
mod filter;
mod fullscreen;
mod kept;
mod label;
mod lighting;
mod order;
mod pass;
mod prepass;
mod present;
mod rays;
mod refine;
#[cfg(feature = "shadows")]
mod shadow;
mod solid;
mod steps;
mod target;
mod transparent;
mod view;
mod volume;

pub use label::{LabelTextures, StageWrite};
#[cfg(feature = "headless")]
pub(crate) use view::ViewMemory;

use bevy::{
    prelude::*,
    render::{ExtractSchedule, RenderApp},
};

/// The names of the spans in Bevy's render diagnostics whose times add up to the time of drawing props.
pub const VOLUME_SPANS: &[&str] = &[
    volume::VOLUME_SPAN,
    volume::BATCHES_SPAN,
    solid::SOLID_SPAN,
    solid::SOLID_BATCHES_SPAN,
    refine::CHECK_SPAN,
    refine::FILL_SPAN,
    kept::COMPARE_DEPTHS_SPAN,
];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of posterizing.
pub const POSTERIZE_SPANS: &[&str] = &[
    kept::COMPARE_COLORS_SPAN,
    edges::EDGES_SPAN,
    composite::COMPOSITE_SPAN,
    filter::FILTER_SPAN,
    label::LABEL_SPAN,
    blend::BLEND_SPAN,
    present::PRESENT_SPAN,
    depth::DEPTH_SPAN,
    prepass::PREPASS_SPAN,
    transparent::TRANSPARENT_SPAN,
];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of drawing props into shadow
/// maps.
#[cfg(feature = "shadows")]
pub const SHADOW_SPANS: &[&str] = &[shadow::SHADOW_SPAN];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of lighting props.
#[cfg(feature = "shadows")]
pub const LIGHTING_SPANS: &[&str] = &[lighting::LIGHTING_SPAN];

/// Draws every [`Prop`](crate::Prop).
pub(crate) struct RenderPropsPlugin;

impl Plugin for RenderPropsPlugin {
    fn build(&self, app: &mut App) {
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app.init_resource::<extract::ExtractedProps>().add_systems(ExtractSchedule, extract::extract_props);
            steps::order(render_app);
        }
        app.add_plugins((
            view::plugin,
            kept::plugin,
            solid::plugin,
            volume::plugin,
            refine::plugin,
            edges::plugin,
            composite::plugin,
            filter::plugin,
            label::plugin,
            blend::plugin,
            present::plugin,
            depth::plugin,
            prepass::plugin,
            transparent::plugin,
        ));
        app.add_plugins((
            lighting::plugin,
            #[cfg(feature = "shadows")]
            shadow::plugin,
        ));
    }
}
