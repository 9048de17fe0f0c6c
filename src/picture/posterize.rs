//! The posterise pass: composite, bilateral filter, labels. Section 4 of the method.

use bevy::{
    camera::CompositingSpace,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent, BlendState,
            Buffer, BufferBinding, BufferInitDescriptor, BufferUsages, CachedComputePipelineId, CachedRenderPipelineId,
            ColorTargetState, ColorWrites, ComputePassDescriptor, ComputePipelineDescriptor, FragmentState,
            PipelineCache, RenderPassDescriptor, RenderPipelineDescriptor, ShaderStages, SpecializedComputePipeline,
            SpecializedComputePipelines, SpecializedRenderPipeline, SpecializedRenderPipelines, StorageTextureAccess,
            TextureFormat, TextureSampleType, TextureViewId, VertexState,
            binding_types::{texture_2d, texture_storage_2d, uniform_buffer},
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ExtractedView, ViewTarget},
    },
    shader::{Shader, ShaderDefVal},
};

use super::{
    MAX_FILTER_ITERATIONS, MAX_FILTER_RADIUS,
    textures::{LAYER_FORMAT, PropTextures},
    view::{ViewLayouts, ViewProps},
};
use crate::gpu::Shaders;

/// Name of the pass's span in Bevy's render diagnostics.
pub const POSTERIZE_SPAN: &str = "plenoctree_posterize";

/// The target stores encoded sRGB, so nothing is decoded for it.
const ENCODED_TARGET: &str = "ENCODED_TARGET";
/// Pixels a side of a workgroup of `composite.wgsl` and of `bilateral.wgsl`.
const COMPOSITE_TILE: u32 = 8;
const FILTER_TILE: u32 = 16;
/// Distance of two values in the buffer of iterations: no device asks for more.
const ITERATION_STRIDE: u32 = 256;

#[derive(Resource)]
pub(super) struct CompositePipeline {
    shader: Handle<Shader>,
    view: BindGroupLayoutDescriptor,
    layout: BindGroupLayoutDescriptor,
}

#[derive(Resource)]
pub(super) struct FilterPipelines {
    layout: BindGroupLayoutDescriptor,
    horizontal: CachedComputePipelineId,
    vertical: CachedComputePipelineId,
    /// 0, 1, 2, ... at distances of [`ITERATION_STRIDE`].
    iterations: Buffer,
}

#[derive(Resource)]
pub(super) struct LabelPipeline {
    shader: Handle<Shader>,
    view: BindGroupLayoutDescriptor,
    layout: BindGroupLayoutDescriptor,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct LabelKey {
    format: TextureFormat,
    samples: u32,
    encoded: bool,
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    shaders: Res<Shaders>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let picture = || texture_2d(TextureSampleType::Float { filterable: false });
    let store = || texture_storage_2d(LAYER_FORMAT, StorageTextureAccess::WriteOnly);
    commands.insert_resource(CompositePipeline {
        shader: shaders.composite.clone(),
        view: views.picture.clone(),
        layout: BindGroupLayoutDescriptor::new(
            "plenoctree_composite",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (picture(), picture(), picture(), store(), store()),
            ),
        ),
    });

    let layout = BindGroupLayoutDescriptor::new(
        "plenoctree_filter",
        &BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (picture(), store(), uniform_buffer::<UVec4>(true))),
    );
    let filter = shaders.bilateral.clone();
    let direction = |horizontal: bool| {
        let mut shader_defs = vec![ShaderDefVal::UInt("MAX_RADIUS".into(), MAX_FILTER_RADIUS)];
        if horizontal {
            shader_defs.push("HORIZONTAL".into());
        }
        cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some("plenoctree_filter".into()),
            layout: vec![views.picture.clone(), layout.clone()],
            shader: filter.clone(),
            shader_defs,
            entry_point: Some("bilateral".into()),
            ..default()
        })
    };
    let words: Vec<u32> = (0..MAX_FILTER_ITERATIONS)
        .flat_map(|iteration| {
            std::iter::once(iteration).chain(std::iter::repeat_n(0, ITERATION_STRIDE as usize / 4 - 1))
        })
        .collect();
    commands.insert_resource(FilterPipelines {
        horizontal: direction(true),
        vertical: direction(false),
        layout,
        iterations: device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("plenoctree_iterations"),
            contents: bytemuck::cast_slice(&words),
            usage: BufferUsages::UNIFORM,
        }),
    });

    commands.insert_resource(LabelPipeline {
        shader: shaders.posterize.clone(),
        view: views.picture.clone(),
        layout: BindGroupLayoutDescriptor::new(
            "plenoctree_label",
            &BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (picture(), picture())),
        ),
    });
}

impl SpecializedComputePipeline for CompositePipeline {
    /// Whether the target is encoded.
    type Key = bool;

    fn specialize(&self, encoded: bool) -> ComputePipelineDescriptor {
        ComputePipelineDescriptor {
            label: Some("plenoctree_composite".into()),
            layout: vec![self.view.clone(), self.layout.clone()],
            shader: self.shader.clone(),
            shader_defs: if encoded { vec![ENCODED_TARGET.into()] } else { vec![] },
            entry_point: Some("composite".into()),
            ..default()
        }
    }
}

impl SpecializedRenderPipeline for LabelPipeline {
    type Key = LabelKey;

    fn specialize(&self, key: LabelKey) -> RenderPipelineDescriptor {
        let mut descriptor = RenderPipelineDescriptor {
            label: Some("plenoctree_label".into()),
            layout: vec![self.view.clone(), self.layout.clone()],
            vertex: VertexState { shader: self.shader.clone(), entry_point: Some("vertex".into()), ..default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: if key.encoded { vec![ENCODED_TARGET.into()] } else { vec![] },
                entry_point: Some("fragment".into()),
                targets: vec![Some(ColorTargetState {
                    format: key.format,
                    // The colour is composited already; only what the target knows of opacity is added to.
                    blend: Some(BlendState { color: BlendComponent::REPLACE, alpha: BlendComponent::OVER }),
                    write_mask: ColorWrites::ALL,
                })],
            }),
            ..default()
        };
        descriptor.multisample.count = key.samples;
        descriptor
    }
}

/// The pipelines of one view.
#[derive(Component)]
pub(super) struct PosterizePipelines {
    composite: CachedComputePipelineId,
    label: CachedRenderPipelineId,
}

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    composite: Res<CompositePipeline>,
    label: Res<LabelPipeline>,
    mut composites: ResMut<SpecializedComputePipelines<CompositePipeline>>,
    mut labels: ResMut<SpecializedRenderPipelines<LabelPipeline>>,
    views: Query<(Entity, &ExtractedView, &ExtractedCamera, &Msaa), With<ViewProps>>,
) {
    for (entity, view, camera, msaa) in &views {
        let encoded = camera.compositing_space == Some(CompositingSpace::Srgb);
        let key = LabelKey { format: view.target_format, samples: msaa.samples(), encoded };
        commands.entity(entity).insert(PosterizePipelines {
            composite: composites.specialize(&cache, &composite, encoded),
            label: labels.specialize(&cache, &label, key),
        });
    }
}

/// The bind groups of one view.
#[derive(Component)]
pub(super) struct PosterizeBindGroups {
    view: BindGroup,
    /// One for each main texture that the target may be drawing to, with its identity.
    composite: [(TextureViewId, BindGroup); 2],
    horizontal: BindGroup,
    vertical: BindGroup,
    label: BindGroup,
}

pub(super) fn prepare_bind_groups(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    composite: Res<CompositePipeline>,
    filter: Res<FilterPipelines>,
    label: Res<LabelPipeline>,
    views: Query<(Entity, &ViewProps, &PropTextures, &ViewTarget)>,
) {
    for (entity, props, textures, target) in &views {
        let (Some(view), Some(list), Some(colors), false) =
            (props.view.binding(), props.props.binding(), props.colors.binding(), props.fields.is_empty())
        else {
            commands.entity(entity).remove::<PosterizeBindGroups>();
            continue;
        };
        let group = |name: &'static str, layout, entries: &[_]| {
            device.create_bind_group(name, &cache.get_bind_group_layout(layout), entries)
        };
        let filter_group = |from, to| {
            let iteration = BufferBinding { buffer: &filter.iterations, offset: 0, size: std::num::NonZero::new(16) };
            group("plenoctree_filter", &filter.layout, &BindGroupEntries::sequential((from, to, iteration)))
        };
        commands.entity(entity).insert(PosterizeBindGroups {
            view: group(
                "plenoctree_picture_view",
                &layouts.picture,
                &BindGroupEntries::sequential((view, list, colors)),
            ),
            composite: [target.main_texture_view(), target.main_texture_other_view()].map(|scene| {
                let entries = (&textures.layer, &textures.owner, scene, &textures.even, &textures.odd);
                (scene.id(), group("plenoctree_composite", &composite.layout, &BindGroupEntries::sequential(entries)))
            }),
            horizontal: filter_group(&textures.even, &textures.odd),
            vertical: filter_group(&textures.odd, &textures.even),
            label: group(
                "plenoctree_label",
                &label.layout,
                &BindGroupEntries::sequential((&textures.even, &textures.layer)),
            ),
        });
    }
}

pub(super) fn posterize_pass(
    view: ViewQuery<(&ExtractedCamera, &ViewTarget, &ViewProps, &PosterizePipelines, &PosterizeBindGroups)>,
    cache: Res<PipelineCache>,
    filter: Res<FilterPipelines>,
    mut ctx: RenderContext,
) {
    let (camera, target, props, pipelines, groups) = view.into_inner();
    let scene = target.main_texture_view().id();
    let Some((_, scene)) = groups.composite.iter().find(|(id, _)| *id == scene) else {
        return;
    };
    let (Some(composite), Some(horizontal), Some(vertical), Some(label), Some(size)) = (
        cache.get_compute_pipeline(pipelines.composite),
        cache.get_compute_pipeline(filter.horizontal),
        cache.get_compute_pipeline(filter.vertical),
        cache.get_render_pipeline(pipelines.label),
        camera.physical_viewport_size,
    ) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), POSTERIZE_SPAN);
    {
        let descriptor = ComputePassDescriptor { label: Some(POSTERIZE_SPAN), timestamp_writes: None };
        let mut pass = ctx.command_encoder().begin_compute_pass(&descriptor);
        pass.set_bind_group(0, &groups.view, &[]);
        pass.set_pipeline(composite);
        pass.set_bind_group(1, scene, &[]);
        pass.dispatch_workgroups(size.x.div_ceil(COMPOSITE_TILE), size.y.div_ceil(COMPOSITE_TILE), 1);
        let tiles = size.map(|pixels| pixels.div_ceil(FILTER_TILE));
        for iteration in 0..props.iterations.unwrap_or(0) {
            for (pipeline, group) in [(horizontal, &groups.horizontal), (vertical, &groups.vertical)] {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(1, group, &[iteration * ITERATION_STRIDE]);
                pass.dispatch_workgroups(tiles.x, tiles.y, 1);
            }
        }
    }
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(POSTERIZE_SPAN),
            color_attachments: &[Some(target.get_color_attachment())],
            ..default()
        });
        if let Some(viewport) = camera.viewport.as_ref() {
            pass.set_camera_viewport(viewport);
        }
        pass.set_render_pipeline(label);
        pass.set_bind_group(0, &groups.view, &[]);
        pass.set_bind_group(1, &groups.label, &[]);
        pass.draw(0..3, 0..1);
    }
    span.end(ctx.command_encoder());
}
