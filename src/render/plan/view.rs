//! What a view draws.

use bevy::{
    camera::{CompositingSpace, MainPassResolutionOverride, Viewport},
    core_pipeline::tonemapping::Tonemapping,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{BindGroup, TextureFormat},
    },
    shader::Shader,
};

use super::motion::Former;
use crate::{
    camera::PropPlacement,
    gpu::{FieldShape, Level},
    render::uniforms::{LabelsUniform, PlanValues, Rect, Smooths},
};

/// Pixels per ray of the grid, along each axis, where rays are cast for some pixels only. Matches `batch.wgsl`.
pub(in crate::render) const SPACING: u32 = 2;
/// The pixels along a side of the square whose gaps or edges form a batch, and of the one in which it is drawn. Matches
/// `batch.wgsl`.
pub(in crate::render) const BATCH: u32 = 16;

/// Returns the numbers of batches for `size` pixels, along each axis.
pub(in crate::render) fn batches(size: UVec2) -> UVec2 {
    (size + BATCH - 1) / BATCH
}

/// Everything that is decided about a frame of a view.
#[derive(Clone, Default)]
pub(in crate::render) struct Plan {
    /// The part of the target that the camera draws to.
    pub viewport: Viewport,
    /// The part of the viewport that is drawn, which includes what the filter reads around the props.
    pub rect: Rect,
    /// Where in the frame the props are shown.
    pub placement: PropPlacement,
    /// The props, back to front.
    pub props: Vec<PlannedProp>,
    /// The samples per pixel of the scene's depth.
    pub samples: u32,
    /// The camera's target, as the last passes see it.
    pub target: Target,
    /// Whether rays are cast for some pixels only, at first.
    pub is_sparse: bool,
    /// The largest number of filter iterations.
    pub iterations: u32,
    /// Whether the filter reads no pixels of other owners, or of none.
    pub filters_apart: bool,
    pub posterizes: bool,
    /// Whether a posterized view owns the pixels that no posterized prop owns.
    pub posterizes_view: bool,
    /// Whether the nearest solid prop of every pixel must be known before props are drawn.
    pub overlaps: bool,
    /// Whether there is fog before the props.
    pub has_fog: bool,
    /// How the tones of this fog are mapped before it is shown.
    pub tonemapping: Option<Tonemapping>,
    pub is_lit: bool,
    pub is_brightened: bool,
    pub has_lamps: bool,
    /// Whether all light on props is smoothed afterward, and with it the edges of shadows.
    pub smooths_all_light: bool,
    pub has_hard_shadows: bool,
    pub has_several_props: bool,
    pub smooths: bool,
    /// Whether edges follow from opacity alone where it says enough.
    pub estimates_edges: bool,
    pub has_smooth_borders: bool,
    pub has_ink: bool,
    /// Whether the palette of a prop as trained has changed.
    pub recolors: bool,
    /// This frame, if the next one may keep its labels.
    pub former: Option<Former>,
    /// Whether the last frame becomes the former one, whose labels pixels may keep.
    pub follows_last: bool,
    pub has_motion: bool,
    pub stages: Vec<Handle<Shader>>,
    /// Whether transparent objects are drawn over props at the display.
    pub has_objects: bool,
    pub values: PlanValues,
}

/// The properties of a camera's target that pipelines depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) struct Target {
    pub format: TextureFormat,
    pub samples: u32,
    pub space: Option<CompositingSpace>,
    pub size: UVec2,
}

impl Default for Target {
    fn default() -> Self {
        Self { format: TextureFormat::Rgba8UnormSrgb, samples: 1, space: None, size: UVec2::ZERO }
    }
}

/// What is drawn of a prop.
#[derive(Clone)]
pub(in crate::render) struct PlannedProp {
    pub entity: Entity,
    /// Its index in `ExtractedProps::props`.
    pub index: usize,
    /// Bind group 1 of passes that march through it, at this level.
    pub field: BindGroup,
    pub level: Level,
    pub kind: Kind,
    /// Whether any part of it may be solid.
    pub may_be_solid: bool,
    pub is_posterized: bool,
    pub smooths: Smooths,
    /// The pixels of the drawn part of the view that its box can cover.
    pub rect: URect,
    /// Whether it is not drawn, because its pipeline is not ready.
    pub is_left_out: bool,
}

impl PlannedProp {
    /// Returns whether it may hide others that it overlaps.
    pub fn may_hide(&self) -> bool {
        self.kind.overlaps && self.may_be_solid
    }

    /// Returns the first of the batches that may have pixels of its box, and their numbers along each axis.
    pub fn batches(&self) -> (UVec2, UVec2) {
        let first = self.rect.min / BATCH;
        let size = if self.rect.is_empty() { UVec2::ZERO } else { batches(self.rect.max) - first };
        (first, size)
    }
}

/// What the programs of a prop are compiled for. A field of SH1 does not pay for the arithmetic of SH9, and a prop that
/// overlaps no other does not pay for what overlapping props need.
#[derive(Clone, Copy, PartialEq)]
pub(in crate::render) struct Kind {
    pub shape: FieldShape,
    /// Whether it may cover the same pixels as another one, in a view where one of the two may be solid.
    pub overlaps: bool,
    pub is_lit: bool,
    /// Whether it is drawn as trained, and recolored if its palette has changed.
    pub may_recolor: bool,
}

/// What a view can do without until its pipelines are compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum Feature {
    /// Drawing props at all.
    Base,
    Fog,
    Posterize,
    Lighting,
    /// Transparent objects over props at the display.
    Objects,
    /// Fewer rays than pixels.
    Sparse,
    Edges,
    /// Smooth borders between labels, ink, and steady labels.
    Finish,
    Stages,
}

impl Plan {
    /// Returns the props that are not left out.
    pub fn drawn_props(&self) -> impl Iterator<Item = &PlannedProp> {
        self.props.iter().filter(|prop| !prop.is_left_out)
    }

    /// Returns the corner of the drawn part in the target.
    pub fn corner(&self) -> UVec2 {
        self.viewport.physical_position + self.rect.low
    }

    /// Returns whether borders or ink are drawn after labels.
    pub fn finishes(&self) -> bool {
        self.has_smooth_borders || self.has_ink
    }

    /// Returns whether the composite pass finds the pixels at edges. With several props, the coverage pass would replace
    /// what it writes, and at the display, it runs long after the coverage pass.
    pub fn composite_outlines(&self) -> bool {
        self.smooths && !self.has_several_props && self.placement == PropPlacement::Scene
    }

    /// Returns the number of lists of pixels at edges. With several props, each field has one more. See `list_of` of
    /// `batch.wgsl`.
    pub fn edge_lists(&self) -> u32 {
        self.values.view.edge_lists << u32::from(self.has_several_props)
    }

    /// Returns whether anything is drawn over what the label pass shows: borders, ink, or smooth edges.
    pub fn changes_labels(&self) -> bool {
        self.finishes() || self.smooths
    }

    /// Returns whether labels are kept from frame to frame while something moves.
    pub fn steadies(&self) -> bool {
        self.former.is_some()
    }

    /// Returns whether any prop keeps labels, of the former frame or of the one before the view came to rest.
    pub fn reads_former(&self) -> bool {
        self.former.as_ref().is_some_and(Former::keeps_labels)
    }

    /// Returns whether later passes, or the next frame, read the labels of pixels.
    pub fn needs_labels(&self) -> bool {
        self.finishes() || self.steadies() || !self.stages.is_empty()
    }

    /// Returns whether layers say who owns a pixel. Rays of different owners are not interpolated.
    pub fn has_owners(&self) -> bool {
        self.posterizes || self.is_lit || self.is_sparse
    }

    /// Returns whether it has a feature that must not go while pipelines are compiled. Custom stages may: their shaders
    /// may never compile.
    pub fn keeps(&self, feature: Feature) -> bool {
        match feature {
            Feature::Base => !self.props.is_empty() || self.posterizes_view,
            Feature::Fog => self.has_fog,
            Feature::Posterize => self.posterizes,
            Feature::Lighting => self.is_lit,
            Feature::Objects => self.has_objects,
            Feature::Sparse => self.is_sparse,
            Feature::Edges => self.smooths,
            Feature::Finish => self.finishes() || self.steadies(),
            Feature::Stages => false,
        }
    }

    /// Returns how the prop at an index of the plan is labeled: by itself, or by the posterized view.
    pub fn labeling_of(&self, prop: usize) -> Option<&LabelsUniform> {
        let labelings = &self.values.labelings;
        match self.props.get(prop) {
            Some(planned) if planned.is_posterized => labelings.get(prop),
            _ if self.posterizes_view => labelings.last(),
            _ => None,
        }
    }

    /// Returns the number of samples per pixel of a target in which some samples may show something in front of a prop,
    /// while others show the prop. `None` if there is only one, or if custom stages or a posterized view decide what is
    /// shown.
    pub fn hidden_samples(&self) -> Option<u32> {
        let shows_scene = self.placement == PropPlacement::Scene && self.stages.is_empty() && !self.posterizes_view;
        Some(self.samples).filter(|samples| *samples > 1 && shows_scene)
    }
}

/// Returns the part of a view's target that its main pass draws to, in pixels, or `None` if it is empty.
pub(in crate::render) fn drawn_viewport(
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
