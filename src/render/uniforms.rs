//! The uniforms that `view.wgsl` declares, and the buffers that hold them.

use bevy::{
    prelude::*,
    render::{
        render_resource::{BindingResource, BufferUsages, ShaderType},
        renderer::{RenderDevice, RenderQueue},
    },
};
use glam::{DMat4, DVec2};

use super::{
    colors::PlacedPalette,
    extract::{ExtractedInk, ExtractedPosterize, ExtractedProp},
    rays::Rays,
};
use crate::{gpu::WrittenBuffer, posterize::BorderSmoothing, prop::SolidOpacity, quality::PropQuality};

/// How rays go through a prop, and where it counts as solid or posterized. Matches `Prop` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct PropUniform {
    clip_from_box: Mat4,
    origin: Mat3,
    direction: Mat3,
    scale: Vec3,
    mirrored: u32,
    low: Vec3,
    posterized: u32,
    high: Vec3,
    min_opacity: f32,
    reference: Vec2,
    near: f32,
    solid_transmittance: f32,
    tint: Vec3,
    smooths: u32,
    previous_from_clip: Mat4,
    /// The first of the batches that may have pixels of its box, and how many there are in a row.
    pub first_batch: UVec2,
    pub batches_across: u32,
    /// The number of its field and level, among those of props with smooth edges.
    pub field: u32,
}

/// Which edges of a prop are smooth. Matches `view.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Smooths {
    Nothing,
    Silhouette,
    /// Also slits through it, behind which there may only be the scene.
    Slits,
}

impl PropUniform {
    /// `rect` is the part of the viewport that is drawn, and `posterize` says how the prop is posterized, if it is.
    pub fn new(
        prop: &ExtractedProp,
        rays: &Rays,
        rect: &Rect,
        previous_from_clip: DMat4,
        quality: &PropQuality,
        posterize: Option<&ExtractedPosterize>,
        smooths: Smooths,
    ) -> Self {
        let settings = posterize.map(|posterize| posterize.settings).unwrap_or_default();
        Self {
            clip_from_box: near_one(rect.clip_from_viewport() * rays.clip_from_box).as_mat4(),
            posterized: posterize.is_some().into(),
            min_opacity: settings.min_opacity,
            tint: prop.tint,
            smooths: smooths as u32,
            previous_from_clip: (previous_from_clip * rect.viewport_from_clip()).as_mat4(),
            reference: (rays.reference - rect.low.as_dvec2()).as_vec2(),
            ..Self::caster(prop, rays, quality)
        }
    }

    /// Creates the uniform of a prop that casts a shadow.
    pub fn caster(prop: &ExtractedProp, rays: &Rays, quality: &PropQuality) -> Self {
        let matrix =
            |columns: [glam::DVec3; 3]| Mat3::from_cols_array_2d(&columns.map(|column| column.as_vec3().into()));
        Self {
            origin: matrix(rays.origin),
            direction: matrix(rays.direction),
            scale: prop.pose.frame.scale.as_vec3(),
            mirrored: u32::from(rays.mirrored),
            low: rays.low.as_vec3(),
            high: rays.high.as_vec3(),
            reference: rays.reference.as_vec2(),
            near: rays.near as f32,
            solid_transmittance: solid_transmittance(prop.solid, quality),
            ..default()
        }
    }

    /// Creates the uniform of a posterized view, which no ray goes through.
    pub fn view_posterize() -> Self {
        Self { tint: Vec3::ONE, ..default() }
    }

    /// Returns the same caster with texels counted from another one, and rays that begin at another distance.
    #[cfg(feature = "shadows")]
    pub fn at(&self, shift: IVec2, near: f32) -> Self {
        Self { reference: self.reference + shift.as_vec2(), near, ..*self }
    }

    /// Creates the uniform of a tile that begins at a texel of a map, and whose distances begin at one along the axis.
    #[cfg(feature = "shadows")]
    pub fn tile(corner: IVec2, near: f32) -> Self {
        Self { reference: corner.as_vec2(), near, ..default() }
    }

    /// Returns the same caster or tile, drawn to a part of a texture. See `shadow.wgsl`.
    #[cfg(feature = "shadows")]
    pub fn drawn_to(&self, clip_from_part: Mat4) -> Self {
        Self { clip_from_box: clip_from_part, ..*self }
    }
}

/// Returns the same transform of homogeneous coordinates, with numbers near 1: while a graphics card clips triangles,
/// it multiplies the coordinates of their vertices, and those of tiny and huge props would leave the range of float32.
fn near_one(clip_from_box: DMat4) -> DMat4 {
    let largest =
        clip_from_box.to_cols_array().into_iter().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
    // A power of two rounds no digit.
    clip_from_box * (-largest.log2().floor()).exp2()
}

/// What is filtered before a prop, or a posterized view, is labeled, and how. Matches `Filter` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct FilterUniform {
    pub iterations: u32,
    taps: i32,
    spacing: f32,
    spatial_falloff: f32,
    range_falloff: f32,
    is_of_tones: u32,
}

impl FilterUniform {
    pub fn new(posterize: Option<&ExtractedPosterize>, quality: &PropQuality) -> Self {
        let Some(posterize) = posterize else {
            return default();
        };
        let filter = posterize.settings.filter;
        let taps = filter.taps.min(filter.radius);
        let falloff = |sigma: f32| 0.5 / (sigma * sigma);
        Self {
            iterations: filter.iterations.min(quality.filter_iterations),
            taps: taps as i32,
            spacing: filter.radius as f32 / taps.max(1) as f32,
            spatial_falloff: falloff(filter.spatial_sigma),
            range_falloff: falloff(filter.range_sigma),
            is_of_tones: u32::from(posterize.palette.is_of_tones()),
        }
    }

    /// Returns whether it reads no pixels of other owners, or of none.
    pub fn is_apart(&self) -> bool {
        self.iterations == 0 || self.is_of_tones > 0
    }
}

/// The labels of a prop, or of a posterized view. Matches `Labels` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct LabelsUniform {
    pub colors: u32,
    pub first_color: u32,
    pub blend_steps: u32,
    softness: f32,
    first_place: u32,
    pub smooth_borders: u32,
    recolors: u32,
    steadiness: f32,
    pub ink: ExtractedInk,
    former: FormerPlace,
}

impl LabelsUniform {
    /// `pixels` says how many of them a world unit covers at w = 1 in clip space.
    pub fn new(
        posterize: Option<&ExtractedPosterize>,
        palette: Option<&PlacedPalette>,
        ink: Option<ExtractedInk>,
        pixels: f32,
    ) -> Self {
        let Some(palette) = palette else {
            return default();
        };
        let of_palette = Self {
            colors: palette.colors,
            first_color: palette.first_color,
            first_place: palette.first_place,
            recolors: palette.is_changed.into(),
            ..default()
        };
        let Some(posterize) = posterize else {
            return of_palette;
        };
        let settings = &posterize.settings;
        let ink = ink.unwrap_or_default();
        Self {
            // The paper shows thin pixels as rendered.
            recolors: u32::from(palette.is_changed && settings.borders == BorderSmoothing::Interpolated),
            blend_steps: settings.blend_steps,
            softness: settings.softness,
            smooth_borders: settings.smooths_borders().into(),
            ink: ExtractedInk { width: ink.width * pixels, ..ink },
            ..of_palette
        }
    }

    /// Lets pixels keep the labels of the former frame, unless another one is nearer by more than `steadiness`.
    pub(super) fn steady(self, steadiness: f32, former: FormerPlace) -> Self {
        Self { steadiness, former, ..self }
    }
}

/// What shaders know of a prop in the former frame. Matches `FormerPlace` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct FormerPlace {
    /// From clip space of what is drawn now to that of what was drawn then.
    pub from_clip: Mat4,
    /// The size of what was drawn then, in pixels.
    pub size: Vec2,
    /// 1 + the index of the prop then.
    pub owner: u32,
}

/// The part of a target that is drawn, and the rays through it. Matches `View` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct ViewUniform {
    pub corner: UVec2,
    pub size: UVec2,
    pub depth: Vec4,
    pub spacing: u32,
    pub ray_tolerance: f32,
    pub stop_transmittance: f32,
    pub edge_rays: u32,
    pub unjittered_from_clip: Mat4,
    pub depth_range: Vec2,
    /// The number of props, and of the posterized view.
    pub props: u32,
    /// The number of lists of pixels at edges, a power of two. See `list_of` of `batch.wgsl`.
    pub edge_lists: u32,
    /// With parallel rays, the height of the viewport in world units, and otherwise 0.
    pub height: f32,
}

/// How colors are shown. Matches `Screen` in `view.wgsl`.
#[cfg_attr(test, derive(Reflect))]
#[derive(ShaderType, Clone, Copy, Default, PartialEq)]
pub(super) struct ScreenUniform {
    pub exposure: f32,
    pub view_posterize: u32,
}

/// The part of a viewport that is drawn, in pixels. Its pixels are counted from its own corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rect {
    pub low: UVec2,
    pub size: UVec2,
    pub viewport: UVec2,
}

impl Rect {
    /// Returns the transform from the clip space of the viewport to that of this part.
    pub fn clip_from_viewport(&self) -> DMat4 {
        let size = self.size.as_dvec2();
        let scale = self.viewport.as_dvec2() / size;
        let shift = (scale - 1.0 - 2.0 * self.low.as_dvec2() / size) * DVec2::new(1.0, -1.0);
        DMat4::from_translation(shift.extend(0.0)) * DMat4::from_scale(scale.extend(1.0))
    }

    /// Returns the transform from the clip space of this part to that of the viewport.
    pub fn viewport_from_clip(&self) -> DMat4 {
        self.clip_from_viewport().inverse()
    }
}

/// Returns the transmittance at which a prop is solid, or a negative value for never. Rays that stop count as solid,
/// but empty parts of a prop never do.
fn solid_transmittance(solid: SolidOpacity, quality: &PropQuality) -> f32 {
    match solid {
        SolidOpacity::At(opacity) => (1.0 - opacity.clamp(f32::EPSILON, 1.0)).max(quality.stop_transmittance),
        SolidOpacity::Never => -1.0,
    }
}

/// The values of the uniforms of a plan.
#[derive(Clone, Default)]
pub(super) struct PlanValues {
    pub view: ViewUniform,
    pub screen: ScreenUniform,
    /// One for each prop, and one for the posterized view, if there is one.
    pub props: Vec<PropUniform>,
    pub filters: Vec<FilterUniform>,
    pub labelings: Vec<LabelsUniform>,
    /// A number that is different for different colors of the view's palettes, and for other pairs of ramps with ink.
    pub palettes: u64,
}

/// The buffers of a view.
#[derive(Default)]
pub(super) struct ViewBuffers {
    pub view: WrittenBuffer,
    pub props: WrittenBuffer,
    pub screen: WrittenBuffer,
    pub filters: WrittenBuffer,
    pub labelings: WrittenBuffer,
    /// See `Cache::first_drawn`.
    pub first_drawn: WrittenBuffer,
    pub lit: WrittenBuffer,
    pub shades: WrittenBuffer,
    /// Bevy's fog of a camera without any.
    pub no_fog: WrittenBuffer,
}

/// The palettes of all props and posterized views.
#[derive(Resource, Default)]
pub(super) struct PaletteBuffer(pub WrittenBuffer);

impl ViewBuffers {
    pub fn set(&mut self, device: &RenderDevice, queue: &RenderQueue, values: &PlanValues) {
        let storage = BufferUsages::STORAGE;
        self.view.set(device, queue, "plenoctree_view", BufferUsages::UNIFORM, &values.view);
        self.props.set(device, queue, "plenoctree_props", storage, &values.props);
        self.screen.set(device, queue, "plenoctree_screen", BufferUsages::UNIFORM, &values.screen);
        self.filters.set(device, queue, "plenoctree_filters", storage, &values.filters);
        self.labelings.set(device, queue, "plenoctree_labels", storage, &values.labelings);
        self.no_fog.set(device, queue, "plenoctree_no_fog", BufferUsages::UNIFORM, &[Vec4::ZERO; 5]);
    }

    /// Writes the first result that must be drawn. The GPU changes it, so it is written in every frame.
    pub fn set_first_drawn(&mut self, device: &RenderDevice, queue: &RenderQueue, first: u32) {
        let usage = BufferUsages::UNIFORM | BufferUsages::STORAGE;
        self.first_drawn.hash = 0;
        self.first_drawn.set(device, queue, "plenoctree_first_drawn", usage, &first);
    }

    /// Returns the bindings of bind group 0, if all have been written.
    pub fn bindings<'a>(&'a self, palettes: &'a PaletteBuffer) -> Option<Vec<BindingResource<'a>>> {
        let Self { view, props, screen, filters, labelings, first_drawn, .. } = self;
        let all = [view, props, screen, filters, labelings, &palettes.0, first_drawn];
        all.into_iter().map(WrittenBuffer::binding).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::layouts::assert_layout;

    #[test]
    fn shaders_find_every_field() {
        assert_layout!(PropUniform, "view", "Prop");
        assert_layout!(ViewUniform, "view", "View");
        assert_layout!(ScreenUniform, "view", "Screen");
        assert_layout!(FilterUniform, "view", "Filter");
        assert_layout!(LabelsUniform, "view", "Labels");
        assert_layout!(ExtractedInk, "view", "Ink");
        assert_layout!(FormerPlace, "view", "FormerPlace");
    }
}
