//! The posterise pass: composite, bilateral filter, labels. Section 4 of the method.

use std::num::NonZero;

use bevy::{
    camera::{CompositingSpace, MainPassResolutionOverride},
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent, BlendState,
            Buffer, BufferBinding, BufferInitDescriptor, BufferUsages, CachedRenderPipelineId, ColorTargetState,
            ColorWrites, CompareFunction, DepthStencilState, FragmentState, LoadOp, Operations, PipelineCache,
            RenderPassColorAttachment, RenderPassDescriptor, RenderPipeline, RenderPipelineDescriptor, ShaderStages,
            SpecializedRenderPipeline, SpecializedRenderPipelines, StoreOp, TextureFormat, TextureSampleType,
            TextureView, TextureViewId, VertexState,
            binding_types::{texture_2d, uniform_buffer},
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ExtractedView, ViewDepthTexture, ViewTarget},
    },
    shader::{Shader, ShaderDefVal},
};

use super::{
    textures::{LAYER_FORMAT, PropTextures, drawn_viewport},
    view::{ViewLayouts, ViewProps},
};
use crate::{gpu::Shaders, prop::MAX_FILTER_ITERATIONS};

/// Name of the pass's span in Bevy's render diagnostics.
pub const POSTERIZE_SPAN: &str = "plenoctree_posterize";

/// The target stores encoded sRGB, so nothing is decoded for it.
const ENCODED_TARGET: &str = "ENCODED_TARGET";
/// Distance of two values in the buffer of iterations: no device asks for more.
const ITERATION_STRIDE: u32 = 256;

#[derive(Resource)]
pub(super) struct CompositePipeline(Fullscreen);

#[derive(Resource)]
pub(super) struct FilterPipelines {
    layout: BindGroupLayoutDescriptor,
    horizontal: CachedRenderPipelineId,
    vertical: CachedRenderPipelineId,
    /// 0, 1, 2, ... at distances of [`ITERATION_STRIDE`].
    iterations: Buffer,
}

#[derive(Resource)]
pub(super) struct LabelPipeline(Fullscreen);

/// Writes the props' depth, after the labels.
#[derive(Resource)]
pub(super) struct DepthPipeline(Fullscreen);

/// What the pipelines of the pass have in common: a triangle over the viewport, and the view's bind group first.
struct Fullscreen {
    label: &'static str,
    vertex: Handle<Shader>,
    fragment: Handle<Shader>,
    view: BindGroupLayoutDescriptor,
    layout: BindGroupLayoutDescriptor,
}

impl Fullscreen {
    fn pipeline(&self, shader_defs: Vec<ShaderDefVal>, targets: &[ColorTargetState]) -> RenderPipelineDescriptor {
        RenderPipelineDescriptor {
            label: Some(self.label.into()),
            layout: vec![self.view.clone(), self.layout.clone()],
            vertex: VertexState { shader: self.vertex.clone(), entry_point: Some("vertex".into()), ..default() },
            fragment: Some(FragmentState {
                shader: self.fragment.clone(),
                shader_defs,
                entry_point: Some("fragment".into()),
                targets: targets.iter().cloned().map(Some).collect(),
            }),
            ..default()
        }
    }
}

fn target(format: TextureFormat, blend: Option<BlendState>) -> ColorTargetState {
    ColorTargetState { format, blend, write_mask: ColorWrites::ALL }
}

fn encoded_definitions(encoded: bool) -> Vec<ShaderDefVal> {
    if encoded { vec![ENCODED_TARGET.into()] } else { vec![] }
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    shaders: Res<Shaders>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let picture = || texture_2d(TextureSampleType::Float { filterable: false });
    let fullscreen = |label, fragment: &Handle<Shader>, entries: &[_]| Fullscreen {
        label,
        vertex: shaders.fullscreen.clone(),
        fragment: fragment.clone(),
        view: views.picture.clone(),
        layout: BindGroupLayoutDescriptor::new(label, entries),
    };
    let stages = ShaderStages::FRAGMENT;
    commands.insert_resource(CompositePipeline(fullscreen(
        "plenoctree_composite",
        &shaders.composite,
        &BindGroupLayoutEntries::sequential(stages, (picture(), picture(), picture())),
    )));
    commands.insert_resource(DepthPipeline(fullscreen(
        "plenoctree_depth",
        &shaders.depth,
        &BindGroupLayoutEntries::sequential(stages, (picture(),)),
    )));
    commands.insert_resource(LabelPipeline(fullscreen(
        "plenoctree_label",
        &shaders.posterize,
        &BindGroupLayoutEntries::sequential(stages, (picture(), picture())),
    )));

    let filter = fullscreen(
        "plenoctree_filter",
        &shaders.bilateral,
        &BindGroupLayoutEntries::sequential(stages, (picture(), uniform_buffer::<UVec4>(true))),
    );
    let direction =
        |definitions| cache.queue_render_pipeline(filter.pipeline(definitions, &[target(LAYER_FORMAT, None)]));
    let mut words = vec![0u32; (MAX_FILTER_ITERATIONS * ITERATION_STRIDE / 4) as usize];
    for (iteration, value) in words.chunks_exact_mut(ITERATION_STRIDE as usize / 4).enumerate() {
        value[0] = iteration as u32;
    }
    commands.insert_resource(FilterPipelines {
        horizontal: direction(vec!["HORIZONTAL".into()]),
        vertical: direction(vec![]),
        layout: filter.layout,
        iterations: device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("plenoctree_iterations"),
            contents: bytemuck::cast_slice(&words),
            usage: BufferUsages::UNIFORM,
        }),
    });
}

impl SpecializedRenderPipeline for CompositePipeline {
    /// Whether the target is encoded.
    type Key = bool;

    fn specialize(&self, encoded: bool) -> RenderPipelineDescriptor {
        let picture = || target(LAYER_FORMAT, None);
        self.0.pipeline(encoded_definitions(encoded), &[picture(), picture()])
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct LabelKey {
    format: TextureFormat,
    samples: u32,
    encoded: bool,
}

impl SpecializedRenderPipeline for LabelPipeline {
    type Key = LabelKey;

    fn specialize(&self, key: LabelKey) -> RenderPipelineDescriptor {
        // The colour is composited already; only what the target knows of opacity is added to.
        let blend = BlendState { color: BlendComponent::REPLACE, alpha: BlendComponent::OVER };
        let mut descriptor = self.0.pipeline(encoded_definitions(key.encoded), &[target(key.format, Some(blend))]);
        descriptor.multisample.count = key.samples;
        descriptor
    }
}

impl SpecializedRenderPipeline for DepthPipeline {
    /// Samples a pixel.
    type Key = u32;

    fn specialize(&self, samples: u32) -> RenderPipelineDescriptor {
        let mut descriptor = self.0.pipeline(vec![], &[]);
        descriptor.multisample.count = samples;
        descriptor.depth_stencil = Some(DepthStencilState {
            format: CORE_3D_DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            // What is nearer has the greater value.
            depth_compare: Some(CompareFunction::Greater),
            stencil: default(),
            bias: default(),
        });
        descriptor
    }
}

/// The pipelines of one view.
#[derive(Component)]
pub(super) struct PosterizePipelines {
    composite: CachedRenderPipelineId,
    label: CachedRenderPipelineId,
    depth: CachedRenderPipelineId,
}

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    composite: Res<CompositePipeline>,
    label: Res<LabelPipeline>,
    depth: Res<DepthPipeline>,
    mut composites: ResMut<SpecializedRenderPipelines<CompositePipeline>>,
    mut labels: ResMut<SpecializedRenderPipelines<LabelPipeline>>,
    mut depths: ResMut<SpecializedRenderPipelines<DepthPipeline>>,
    views: Query<(Entity, &ExtractedView, &ExtractedCamera, &Msaa), With<ViewProps>>,
) {
    for (entity, view, camera, msaa) in &views {
        let encoded = camera.compositing_space == Some(CompositingSpace::Srgb);
        let key = LabelKey { format: view.target_format, samples: msaa.samples(), encoded };
        commands.entity(entity).insert(PosterizePipelines {
            composite: composites.specialize(&cache, &composite, encoded),
            label: labels.specialize(&cache, &label, key),
            depth: depths.specialize(&cache, &depth, msaa.samples()),
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
    depth: BindGroup,
}

pub(super) fn prepare_bind_groups(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    composite: Res<CompositePipeline>,
    filter: Res<FilterPipelines>,
    label: Res<LabelPipeline>,
    depth: Res<DepthPipeline>,
    views: Query<(Entity, &ViewProps, &PropTextures, &ViewTarget)>,
) {
    for (entity, props, textures, target) in &views {
        let Some((view, list, colors)) = props.bindings() else {
            commands.entity(entity).remove::<PosterizeBindGroups>();
            continue;
        };
        let group = |name: &'static str, layout, entries: &[_]| {
            device.create_bind_group(name, &cache.get_bind_group_layout(layout), entries)
        };
        let filter_group = |from| {
            let iteration = BufferBinding { buffer: &filter.iterations, offset: 0, size: NonZero::new(16) };
            group("plenoctree_filter", &filter.layout, &BindGroupEntries::sequential((from, iteration)))
        };
        commands.entity(entity).insert(PosterizeBindGroups {
            view: group(
                "plenoctree_picture_view",
                &layouts.picture,
                &BindGroupEntries::sequential((view, list, colors)),
            ),
            composite: [target.main_texture_view(), target.main_texture_other_view()].map(|scene| {
                let entries = (&textures.layer, &textures.owner, scene);
                (scene.id(), group(composite.0.label, &composite.0.layout, &BindGroupEntries::sequential(entries)))
            }),
            horizontal: filter_group(&textures.even),
            vertical: filter_group(&textures.odd),
            label: group(
                label.0.label,
                &label.0.layout,
                &BindGroupEntries::sequential((&textures.even, &textures.layer)),
            ),
            depth: group(depth.0.label, &depth.0.layout, &BindGroupEntries::sequential((&textures.distance,))),
        });
    }
}

pub(super) fn posterize_pass(
    view: ViewQuery<(
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &ViewTarget,
        &ViewDepthTexture,
        &ViewProps,
        &PropTextures,
        &PosterizePipelines,
        &PosterizeBindGroups,
    )>,
    cache: Res<PipelineCache>,
    filter: Res<FilterPipelines>,
    mut ctx: RenderContext,
) {
    let (camera, resolution, view_target, scene_depth, props, textures, pipelines, groups) = view.into_inner();
    let scene = view_target.main_texture_view().id();
    let Some((_, scene)) = groups.composite.iter().find(|(id, _)| *id == scene) else {
        return;
    };
    let (Some(composite), Some(horizontal), Some(vertical), Some(label), Some(depth)) = (
        cache.get_render_pipeline(pipelines.composite),
        cache.get_render_pipeline(filter.horizontal),
        cache.get_render_pipeline(filter.vertical),
        cache.get_render_pipeline(pipelines.label),
        cache.get_render_pipeline(pipelines.depth),
    ) else {
        return;
    };
    if props.rect.is_empty() {
        return;
    }
    let viewport = drawn_viewport(camera, resolution);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), POSTERIZE_SPAN);

    let mut draw = |target: Target, pipeline: &RenderPipeline, group, offsets: &[u32]| {
        let mut descriptor = RenderPassDescriptor { label: Some(POSTERIZE_SPAN), ..default() };
        let attachments;
        match &target {
            Target::Pictures(pictures) => descriptor.color_attachments = pictures,
            Target::Screen => {
                attachments = [Some(view_target.get_color_attachment())];
                descriptor.color_attachments = &attachments;
            }
            Target::Depth => {
                descriptor.depth_stencil_attachment = Some(scene_depth.get_attachment(StoreOp::Store));
            }
        }
        let mut pass = ctx.begin_tracked_render_pass(descriptor);
        let (mut corner, size) = (props.rect.min, props.rect.size());
        if let (Target::Screen | Target::Depth, Some(viewport)) = (target, &viewport) {
            pass.set_camera_viewport(viewport);
            corner += viewport.physical_position;
        }
        pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &groups.view, &[]);
        pass.set_bind_group(1, group, offsets);
        pass.draw(0..3, 0..1);
    };
    draw(Target::Pictures(&[onto(&textures.even), onto(&textures.odd)]), composite, scene, &[]);
    for iteration in 0..props.iterations {
        let offset = [iteration * ITERATION_STRIDE];
        draw(Target::Pictures(&[onto(&textures.odd)]), horizontal, &groups.horizontal, &offset);
        draw(Target::Pictures(&[onto(&textures.even)]), vertical, &groups.vertical, &offset);
    }
    draw(Target::Screen, label, &groups.label, &[]);
    draw(Target::Depth, depth, &groups.depth, &[]);
    span.end(ctx.command_encoder());
}

/// What a draw of the pass writes.
#[derive(Clone, Copy)]
enum Target<'a> {
    /// Pictures of the view's own, as large as its viewport.
    Pictures(&'a [Option<RenderPassColorAttachment<'a>>]),
    /// The view's target.
    Screen,
    /// The view's depth.
    Depth,
}

/// An attachment that keeps the pixels that are not drawn.
fn onto(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    Some(RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
    })
}
