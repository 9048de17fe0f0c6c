//! What the passes of one view share: its props, their palettes, its depth.

use bevy::{
    camera::{Exposure, MainPassResolutionOverride},
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_asset::RenderAssets,
        render_resource::{
            BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, PipelineCache, ShaderStages,
            StorageBuffer, TextureUsages, UniformBuffer,
            binding_types::{
                storage_buffer_read_only, texture_depth_2d, texture_depth_2d_multisampled, uniform_buffer,
            },
        },
        renderer::{RenderDevice, RenderQueue},
        view::ExtractedView,
    },
};

use super::{
    extract::{ExtractedProps, VisibleProps},
    rays::Placement,
    textures::{coarse_size, drawn_viewport},
    uniforms::{PropUniform, ViewUniform},
};
use crate::{
    field::PlenOctree,
    gpu::{FieldLayout, GpuField, Level, Uploader},
    prop::MAX_FILTER_RADIUS,
    view::PropStage,
};

/// The props of one view, back to front, in GPU memory.
#[derive(Component, Default)]
pub(super) struct ViewProps {
    /// How far along the view the middle of every prop is, and its place among the extracted ones.
    order: Vec<(f64, usize)>,
    /// The field of every prop, in the order in which they are drawn, and its form.
    pub fields: Vec<(AssetId<PlenOctree>, Level)>,
    /// The highest degree of spherical harmonics to evaluate.
    pub degree: u32,
    /// Whether fields may be drawn in other forms than their own.
    pub changes_levels: bool,
    /// Most iterations of the filter that a look asks for.
    pub iterations: u32,
    /// The part of the viewport in which there is something to draw, and what the filter reads around it, in pixels.
    pub rect: URect,
    pub stage: PropStage,
    view: UniformBuffer<ViewUniform>,
    /// After the props, the look of everything else, if it is posterized.
    props: StorageBuffer<Vec<PropUniform>>,
    colors: StorageBuffer<Vec<Vec4>>,
}

impl ViewProps {
    /// What bind group 0 begins with; `None` if the view draws nothing.
    pub fn bindings(&self) -> Option<(BindingResource<'_>, BindingResource<'_>, BindingResource<'_>)> {
        if self.rect.is_empty() {
            return None;
        }
        Some((self.view.binding()?, self.props.binding()?, self.colors.binding()?))
    }
}

/// Layouts of bind group 0.
#[derive(Resource)]
pub(super) struct ViewLayouts {
    /// With the depth of the scene: one sample a pixel, multisampled.
    pub depth: [BindGroupLayoutDescriptor; 2],
    /// Without it.
    pub picture: BindGroupLayoutDescriptor,
}

pub(super) fn init_layouts(mut commands: Commands) {
    let shared = || {
        (
            uniform_buffer::<ViewUniform>(false),
            storage_buffer_read_only::<Vec<PropUniform>>(false),
            storage_buffer_read_only::<Vec<Vec4>>(false),
        )
    };
    let stages = ShaderStages::VERTEX_FRAGMENT;
    let with_depth = |depth| {
        let (view, props, colors) = shared();
        let entries = BindGroupLayoutEntries::sequential(stages, (view, props, colors, depth));
        BindGroupLayoutDescriptor::new("plenoctree_depth_view", &entries)
    };
    commands.insert_resource(ViewLayouts {
        depth: [with_depth(texture_depth_2d()), with_depth(texture_depth_2d_multisampled())],
        picture: BindGroupLayoutDescriptor::new(
            "plenoctree_picture_view",
            &BindGroupLayoutEntries::sequential(stages, shared()),
        ),
    });
}

/// Lets the volume pass read the depth of cameras that draw something.
pub(super) fn read_depth(mut cameras: Query<(&mut Camera3d, &VisibleProps)>) {
    for (mut camera, visible) in &mut cameras {
        if !visible.is_empty() {
            camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
        }
    }
}

pub(super) fn prepare_views(
    extracted: Res<ExtractedProps>,
    mut fields: ResMut<RenderAssets<GpuField>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    pipelines: Res<PipelineCache>,
    layout: Res<FieldLayout>,
    mut views: Query<(
        &ExtractedView,
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &VisibleProps,
        &mut ViewProps,
    )>,
) {
    let uploader = Uploader { device: &device, queue: &queue, pipelines: &pipelines, layout: &layout };
    for (view, camera, resolution, visible, mut buffers) in &mut views {
        let quality = &visible.quality;
        buffers.degree = quality.degree;
        buffers.changes_levels = quality.cell_size > 0.0 || Level::new(0, quality) != Level::default();
        let ViewProps { order, fields: drawn, iterations, rect, stage, view: uniform, props, colors, .. } =
            &mut *buffers;
        drawn.clear();
        props.get_mut().clear();
        (*iterations, *rect) = (0, URect::EMPTY);
        let Some(viewport) = drawn_viewport(camera, resolution) else {
            continue;
        };
        let size = viewport.physical_size;
        // After an upscaling, pictures of the main pass's size fit no more.
        *stage = if resolution.is_some() { PropStage::Scene } else { visible.stage };

        let (eye, forward) = (view.world_from_view.translation(), view.world_from_view.forward());
        order.clear();
        order.extend(visible.props.iter().filter_map(|index| {
            let prop = extracted.props.get(*index)?;
            fields.get(prop.field)?.level(Level::default())?;
            Some(((prop.placement.center() - eye.as_dvec3()).dot(forward.as_dvec3()), *index))
        }));
        // The index makes the order of props at the same distance certain, and a stable sort would allocate.
        order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for (_, index) in order {
            let prop = &extracted.props[*index];
            let rays = |placement: &Placement| placement.rays(&view.world_from_view, view.clip_from_view, size);
            let (Some(all), Some(field)) = (rays(&prop.placement), fields.get_mut(prop.field)) else {
                continue;
            };
            let coarser = levels_coarser(all.cell_size, quality.cell_size).min(prop.placement.cells.log2() as u32);
            let level = field.ask(Level::new(coarser, quality), &uploader);
            // What has fewer leaves may be smaller.
            let bounds = field.level(level).and_then(|level| level.bounds);
            let rays = match bounds {
                Some((low, high)) if level != Level::default() => rays(&Placement { low, high, ..prop.placement }),
                _ => Some(all),
            };
            let Some(rays) = rays else {
                continue;
            };
            drawn.push((prop.field, level));
            let covered = covered(rays.clip_from_box, size);
            if !covered.is_empty() {
                *rect = rect.union(covered);
            }
            props.get_mut().push(PropUniform::new(prop, &rays, quality));
        }
        let everything = visible.everything.filter(|look| look.colors > 0);
        if everything.is_some() {
            *rect = URect::from_corners(UVec2::ZERO, size);
            props.get_mut().push(PropUniform::look(everything, quality));
        }
        if rect.is_empty() {
            continue;
        }
        *iterations = props.get().iter().map(PropUniform::filtered).max().unwrap_or(0);
        // Those of all props, so that their places are the same in every view.
        colors.get_mut().clone_from(&extracted.colors);
        if colors.get().is_empty() {
            colors.get_mut().push(Vec4::ZERO);
        }
        let [z, w] = [view.clip_from_view.z_axis, view.clip_from_view.w_axis];
        *uniform.get_mut() = ViewUniform {
            corner: viewport.physical_position,
            size,
            depth: Vec4::new(z.z, w.z, z.w, w.w),
            exposure: exposure(camera, *stage),
            everything: everything.map_or(0, |_| props.get().len() as u32),
            pixel: size.as_vec2() / coarse_size(size, quality.resolution).as_vec2(),
            stop_transmittance: quality.stop_transmittance,
            min_weight: quality.min_weight,
        };
        uniform.write_buffer(&device, &queue);
        props.write_buffer(&device, &queue);
        colors.write_buffer(&device, &queue);
    }
}

/// What a camera makes of the props' light: 1 at the exposure that a camera has without a setting.
fn exposure(camera: &ExtractedCamera, stage: PropStage) -> f32 {
    match stage {
        // Shaders divide by it.
        PropStage::Scene => (camera.exposure / Exposure::default().exposure()).clamp(1e-6, 1e6),
        PropStage::Display => 1.0,
    }
}

/// How many times cells of `size` pixels can be doubled without growing beyond what is `wanted`.
fn levels_coarser(size: f64, wanted: f32) -> u32 {
    // The cast saturates, and makes 0 of NaN.
    (f64::from(wanted) / size).log2().floor().min(32.0) as u32
}

/// The pixels that the image of the unit cube can cover, and the filter's reach around them.
fn covered(clip_from_box: glam::DMat4, size: UVec2) -> URect {
    let everything = URect::from_corners(UVec2::ZERO, size);
    let mut rect = Rect::EMPTY;
    for corner in 0..8 {
        let corner = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let clip = clip_from_box * corner.as_dvec3().extend(1.0);
        if clip.w <= 0.0 {
            return everything;
        }
        let ndc = glam::DVec2::new(clip.x, -clip.y) / clip.w;
        rect = rect.union_point((0.5 * (ndc + 1.0) * size.as_dvec2()).as_vec2());
    }
    let reach = MAX_FILTER_RADIUS as f32 + 1.0;
    let (low, high) = (rect.min - reach, rect.max + reach);
    // The cast saturates.
    everything.intersect(URect::from_corners(low.as_uvec2(), high.as_uvec2()))
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Also when corners of the box are behind the camera.
        #[test]
        fn what_is_seen_of_a_box_is_covered(
            eye in prop::array::uniform3(-1.0..2.0f64),
            target in prop::array::uniform3(-0.5..1.5f64),
            point in prop::array::uniform3(0.0..=1.0f64),
            size_of_box in prop::array::uniform3(0.01..1.0f64),
        ) {
            let (eye, target, size) = (DVec3::from(eye), DVec3::from(target), UVec2::new(1600, 1200));
            prop_assume!((target - eye).length() > 0.01);
            let view = DMat4::look_at_rh(eye, target, DVec3::new(0.1, 1.0, 0.2).normalize());
            let clip_from_box = DMat4::perspective_infinite_reverse_rh(1.0, 4.0 / 3.0, 0.01)
                * view
                * DMat4::from_scale(size_of_box.into());
            let clip = clip_from_box * DVec3::from(point).extend(1.0);
            let ndc = glam::DVec2::new(clip.x, -clip.y) / clip.w;
            if clip.w > 0.0 && ndc.abs().max_element() < 1.0 {
                let pixel = (0.5 * (ndc + 1.0) * size.as_dvec2()).as_uvec2();
                let rect = covered(clip_from_box, size);
                prop_assert!(pixel.cmpge(rect.min).all() && pixel.cmplt(rect.max).all(), "{pixel} in {rect:?}");
            }
        }
    }
}
