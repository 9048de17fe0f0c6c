//! The textures and buffers of a view, by what they hold.

use bevy::{
    core_pipeline::{core_3d::CORE_3D_DEPTH_FORMAT, prepass::MOTION_VECTOR_PREPASS_FORMAT},
    prelude::*,
    render::render_resource::TextureFormat,
};

use crate::render::plan::{BATCH, Plan, SPACING, batches};

/// A texture or a buffer that passes read or draw to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum Slot {
    /// The uniforms of the view and of how colors are shown.
    View,
    Screen,
    /// How lights fall on each prop.
    Lit,
    /// The color that each label shows in each band of light.
    Shades,
    /// Which gaps of each square are in its batch: row by row, a bit per gap.
    BatchGaps,
    /// The same for pixels at edges that need rays, one list after another.
    BatchEdges,
    /// The colors of the scene, as passes read them in the camera's target.
    Scene,
    /// This target, to draw to, and its depth texture or a shadow map.
    Target,
    TargetDepth,
    /// The motion vectors of Bevy's prepass.
    PrepassMotion,
    /// A layer: the props alone. Encoded sRGB premultiplied by opacity, and opacity. Half floats, because 8 bits per
    /// channel would change labels.
    Color(RaySet),
    /// The owner of a pixel, as packed by `pack_owner` of `view.wgsl`.
    Owner(RaySet),
    /// The depth of the props, reversed like that of the scene.
    Depth(RaySet),
    /// How solid props have moved since the previous frame, as a fraction of the viewport.
    Motion(RaySet),
    /// The nearest solid prop, as packed by `pack_solid` of `view.wgsl`, and where it is solid.
    Nearest(RaySet),
    NearestDepth(RaySet),
    /// Where others show through that one, the nearest one through which nothing shows, and where it is solid.
    Opaque(RaySet),
    OpaqueDepth(RaySet),
    /// What is known of the gaps between the rays of the grid, as `batch.wgsl` says.
    Gaps,
    /// The owners that may cover parts of a pixel. See `outline.wgsl`.
    Outline,
    /// These parts: a word per pixel of the drawn part of the view. See `coverage.wgsl`.
    Coverage,
    /// What the rays of edges see of the pixel's owner, and of the other owner. See `coverage.wgsl`.
    OwnRays,
    OtherRays,
    /// A depth that says where props and their edges are, so that later passes run only there. See `edge.wgsl`.
    EdgeMask,
    /// The color of the light that arrives, and the fraction that is blocked, or the light that is added. See
    /// `lighting.wgsl`.
    Light,
    /// The same, smoothed. See `smooth_light.wgsl`.
    SmoothLight,
    /// The composite before and after each iteration of the filter. See `filter_texel.wgsl`. Before that, where rays of
    /// edges reach the owner of the pixel. See `coverage.wgsl`.
    Even,
    /// The composite halfway through an iteration.
    Odd,
    /// What is shown, before the last pass that changes it: encoded sRGB and opacity. The opacity is negative where
    /// nothing is drawn.
    Interim,
    /// The same, after that pass.
    Shown,
    /// The same, as custom stages write it, and then fog: by turns, those with an odd number and those with an even one.
    Staged(usize),
    /// See [`LabelStages`](crate::LabelStages).
    Labels,
    /// The labels and the depth of the former frame. A single pixel while no prop keeps labels.
    FormerLabels,
    FormerDepth,
    /// Transparent objects over props, in the format and the size of the target, resolved and multisampled.
    Objects,
    ObjectSamples,
    /// The depth of the scene without what hides these objects, also in the size of the target.
    SceneDepth,
    /// The shadow of a prop: distances along the light's axis, from where the rays of the prop begin. Negative where it
    /// is not solid. Belongs to a shadow map, not to a view.
    ShadowTile,
}

/// The rays whose results a texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum RaySet {
    /// One per pixel.
    Pixels,
    /// Every [`SPACING`]-th one along each axis.
    Grid,
    /// Those of the pixels between them that need one.
    Batches,
}

impl RaySet {
    /// Returns the size of what holds those of `pixels`.
    pub fn size(self, pixels: UVec2) -> UVec2 {
        match self {
            Self::Pixels => pixels,
            Self::Grid => (pixels + SPACING - 1) / SPACING,
            Self::Batches => BATCH * batches(pixels),
        }
    }
}

pub(in crate::render) const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;
pub(in crate::render) const TILE_FORMAT: TextureFormat = TextureFormat::R32Float;

impl Slot {
    /// The layer of all pixels.
    pub const COLOR: Self = Self::Color(RaySet::Pixels);
    pub const OWNER: Self = Self::Owner(RaySet::Pixels);
    pub const DEPTH: Self = Self::Depth(RaySet::Pixels);

    /// Returns the format of a texture, unless it is that of the target.
    pub fn format(self) -> Option<TextureFormat> {
        use TextureFormat::*;
        Some(match self {
            Self::Color(_) | Self::OwnRays | Self::OtherRays | Self::SmoothLight => Rgba16Float,
            Self::Interim | Self::Shown | Self::Staged(_) => Rgba16Float,
            Self::Owner(_) => Rg16Float,
            Self::Motion(_) | Self::PrepassMotion => MOTION_VECTOR_PREPASS_FORMAT,
            Self::Depth(_) | Self::NearestDepth(_) | Self::OpaqueDepth(_) => DEPTH_FORMAT,
            Self::FormerDepth | Self::SceneDepth => DEPTH_FORMAT,
            Self::TargetDepth => CORE_3D_DEPTH_FORMAT,
            Self::EdgeMask => Depth16Unorm,
            Self::Nearest(_) | Self::Opaque(_) => R32Uint,
            Self::ShadowTile => TILE_FORMAT,
            Self::Gaps => R8Uint,
            Self::Outline | Self::Labels | Self::FormerLabels => Rg16Uint,
            Self::Light => Rgba8Unorm,
            Self::Even | Self::Odd => Rgba32Uint,
            Self::Objects | Self::ObjectSamples | Self::Scene | Self::Target => return None,
            Self::View | Self::Screen | Self::Lit | Self::Shades => return None,
            Self::BatchGaps | Self::BatchEdges | Self::Coverage => return None,
        })
    }

    /// Returns where the light is in which labels are shown, if any falls on props.
    pub fn of_light(plan: &Plan) -> Option<Self> {
        let light = if plan.is_brightened { Self::SmoothLight } else { Self::Light };
        plan.is_lit.then_some(light)
    }

    /// Returns whether it is a storage buffer.
    pub fn is_buffer(self) -> bool {
        use Slot::*;
        matches!(self, Lit | Shades | BatchGaps | BatchEdges | Coverage)
    }

    /// Returns whether it has the size of the camera's target.
    pub fn is_of_target(self) -> bool {
        use Slot::*;
        matches!(self, Target | TargetDepth | PrepassMotion | Objects | ObjectSamples | SceneDepth)
    }

    pub fn rays(self) -> RaySet {
        match self {
            Self::Color(rays) | Self::Owner(rays) | Self::Depth(rays) | Self::Motion(rays) => rays,
            Self::Nearest(rays) | Self::NearestDepth(rays) | Self::Opaque(rays) | Self::OpaqueDepth(rays) => rays,
            Self::Gaps => RaySet::Grid,
            _ => RaySet::Pixels,
        }
    }
}

/// The words that say which gaps, or which pixels at edges, of a square are in its batch. They match `batch.wgsl`.
pub(super) const WORDS_OF_GAPS: u32 = (BATCH / SPACING).pow(2) / 32;
pub(super) const WORDS_OF_EDGES: u32 = BATCH.pow(2) / 32;
