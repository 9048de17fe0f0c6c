//! What the passes of one view share: its props, their palettes, its depth.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_asset::RenderAssets,
        render_resource::{
            BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, ShaderStages, ShaderType,
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
    extract::{ExtractedProps, PaletteColors, VisibleProps},
    textures::drawn_viewport,
};
use crate::{
    field::PlenOctree,
    gpu::GpuField,
    prop::{MAX_BLEND_STEPS, MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS, Posterize},
};

/// `Prop` of `view.wgsl`.
#[derive(ShaderType, Clone, Copy)]
pub(super) struct PropUniform {
    clip_from_box: Mat4,
    origin: Mat3,
    direction: Mat3,
    scale: Vec3,
    mirrored: u32,
    low: Vec3,
    colors: u32,
    high: Vec3,
    first_color: u32,
    blend_steps: u32,
    softness: f32,
    min_opacity: f32,
    iterations: u32,
    radius: i32,
    spatial_falloff: f32,
    range_falloff: f32,
}

/// `View` of `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
pub(super) struct ViewUniform {
    corner: UVec2,
    size: UVec2,
    depth: Vec4,
}

/// The props of one view, back to front, in GPU memory.
#[derive(Component, Default)]
pub(super) struct ViewProps {
    /// The squared distance of every prop, and its place among the extracted ones.
    order: Vec<(f64, usize)>,
    /// The field of every prop, in the order in which they are drawn.
    pub fields: Vec<AssetId<PlenOctree>>,
    /// Most iterations of the filter that a prop asks for.
    pub iterations: u32,
    /// The part of the viewport in which the props are, and what the filter reads around it, in pixels.
    pub rect: URect,
    view: UniformBuffer<ViewUniform>,
    props: StorageBuffer<Vec<PropUniform>>,
    colors: StorageBuffer<Vec<Vec4>>,
}

impl ViewProps {
    /// What bind group 0 begins with; `None` if the view draws no prop.
    pub fn bindings(&self) -> Option<(BindingResource<'_>, BindingResource<'_>, BindingResource<'_>)> {
        if self.fields.is_empty() {
            return None;
        }
        Some((self.view.binding()?, self.props.binding()?, self.colors.binding()?))
    }
}

/// Layouts of bind group 0.
#[derive(Resource)]
pub(super) struct ViewLayouts {
    /// With the depth of the scene, one sample a pixel.
    pub volume: BindGroupLayoutDescriptor,
    /// With the depth of the scene, multisampled.
    pub volume_multisampled: BindGroupLayoutDescriptor,
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
    let volume = |depth| {
        let (view, props, colors) = shared();
        let entries = BindGroupLayoutEntries::sequential(stages, (view, props, colors, depth));
        BindGroupLayoutDescriptor::new("plenoctree_volume_view", &entries)
    };
    commands.insert_resource(ViewLayouts {
        volume: volume(texture_depth_2d()),
        volume_multisampled: volume(texture_depth_2d_multisampled()),
        picture: BindGroupLayoutDescriptor::new(
            "plenoctree_picture_view",
            &BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, shared()),
        ),
    });
}

/// Lets the volume pass read the depth of cameras that see a prop.
pub(super) fn read_depth(mut cameras: Query<(&mut Camera3d, &VisibleProps)>) {
    for (mut camera, visible) in &mut cameras {
        if !visible.0.is_empty() {
            camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
        }
    }
}

pub(super) fn prepare_views(
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<(
        &ExtractedView,
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &VisibleProps,
        &mut ViewProps,
    )>,
) {
    for (view, camera, resolution, visible, mut buffers) in &mut views {
        buffers.fields.clear();
        buffers.iterations = 0;
        buffers.rect = URect::EMPTY;
        let Some(viewport) = drawn_viewport(camera, resolution) else {
            continue;
        };
        let size = viewport.physical_size;

        let eye = view.world_from_view.translation().as_dvec3();
        let ViewProps { order, fields: drawn, iterations, rect, view: uniform, props, colors } = &mut *buffers;
        order.clear();
        order.extend(visible.0.iter().filter_map(|index| {
            let prop = extracted.props.get(*index)?;
            fields.get(prop.field)?.bind_group.as_ref()?;
            Some((prop.placement.center().distance_squared(eye), *index))
        }));
        // The index makes the order of props at the same distance certain, and a stable sort would allocate.
        order.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));

        props.get_mut().clear();
        for (_, index) in order {
            let prop = &extracted.props[*index];
            let Some(rays) = prop.placement.rays(&view.world_from_view, view.clip_from_view, size) else {
                continue;
            };
            let palette = prop.look.map(|(_, palette)| palette);
            let PaletteColors { first, count } = palette.unwrap_or(PaletteColors { first: 0, count: 0 });
            let look = sound(prop.look.map(|(look, _)| look).unwrap_or_default());
            if count > 0 {
                *iterations = (*iterations).max(look.abstraction.iterations);
            }
            let matrix = |columns: [glam::DVec3; 3]| {
                Mat3::from_cols(columns[0].as_vec3(), columns[1].as_vec3(), columns[2].as_vec3())
            };
            let falloff = |sigma: f32| 0.5 / (sigma * sigma);
            drawn.push(prop.field);
            *rect = rect.union(covered(rays.clip_from_box, size));
            props.get_mut().push(PropUniform {
                clip_from_box: rays.clip_from_box.as_mat4(),
                origin: matrix(rays.origin),
                direction: matrix(rays.direction),
                scale: prop.placement.frame.scale.as_vec3(),
                mirrored: u32::from(rays.mirrored),
                low: prop.placement.low.as_vec3(),
                colors: count,
                high: prop.placement.high.as_vec3(),
                first_color: first,
                blend_steps: look.blend_steps,
                softness: look.softness,
                min_opacity: look.min_opacity,
                iterations: look.abstraction.iterations,
                radius: look.abstraction.radius as i32,
                spatial_falloff: falloff(look.abstraction.spatial_sigma),
                range_falloff: falloff(look.abstraction.range_sigma),
            });
        }
        if drawn.is_empty() {
            continue;
        }
        // Those of all props, so that their places are the same in every view.
        colors.get_mut().clone_from(&extracted.colors);
        if colors.get().is_empty() {
            colors.get_mut().push(Vec4::ZERO);
        }
        let [z, w] = [view.clip_from_view.z_axis, view.clip_from_view.w_axis];
        *uniform.get_mut() =
            ViewUniform { corner: viewport.physical_position, size, depth: Vec4::new(z.z, w.z, z.w, w.w) };
        uniform.write_buffer(&device, &queue);
        props.write_buffer(&device, &queue);
        colors.write_buffer(&device, &queue);
    }
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

/// The look with every value in its range, so that no shader divides by zero or loops for long.
fn sound(look: Posterize) -> Posterize {
    let Posterize { blend_steps, softness, min_opacity, mut abstraction } = look;
    abstraction.iterations = abstraction.iterations.min(MAX_FILTER_ITERATIONS);
    abstraction.radius = abstraction.radius.min(MAX_FILTER_RADIUS);
    // f32::max takes the other one for NaN.
    abstraction.spatial_sigma = abstraction.spatial_sigma.max(1e-3);
    abstraction.range_sigma = abstraction.range_sigma.max(1e-3);
    Posterize {
        blend_steps: blend_steps.clamp(1, MAX_BLEND_STEPS),
        softness: softness.max(0.0),
        min_opacity: min_opacity.max(0.0),
        abstraction,
    }
}
