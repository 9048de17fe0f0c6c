//! The volume pass: every visible prop into the view's layer, back to front.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BlendComponent, BlendFactor, BlendOperation,
            BlendState, CachedRenderPipelineId, ColorTargetState, ColorWrites, CompareFunction, Face, FragmentState,
            LoadOp, Operations, PipelineCache, PrimitiveState, RenderPassColorAttachment,
            RenderPassDepthStencilAttachment, RenderPassDescriptor, RenderPipelineDescriptor,
            SpecializedRenderPipeline, SpecializedRenderPipelines, StoreOp, TextureView, VertexState,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::ViewDepthTexture,
    },
    shader::Shader,
};

use super::{
    pipelines::{UpsamplePipeline, depth_test},
    posterize::onto,
    textures::{DEPTH_FORMAT, LAYER_FORMAT, OWNER_FORMAT, PropTextures},
    view::{ViewLayouts, ViewProps},
};
use crate::{
    field::PlenOctree,
    gpu::{FieldLayout, FieldShape, GpuField, GpuLevel, Level, Shaders, field_definitions},
};

/// Name of the pass's span in Bevy's render diagnostics.
pub const VOLUME_SPAN: &str = "plenoctree_volume";

#[derive(Resource)]
pub(super) struct VolumePipeline {
    shader: Handle<Shader>,
    view: [BindGroupLayoutDescriptor; 2],
    field: FieldLayout,
}

/// What the shader is compiled for: a field of SH1 runs no arithmetic of SH9.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct VolumeKey {
    shape: FieldShape,
    degree: u32,
    multisampled: bool,
}

pub(super) fn init(mut commands: Commands, layouts: Res<ViewLayouts>, field: Res<FieldLayout>, shaders: Res<Shaders>) {
    commands.insert_resource(VolumePipeline {
        shader: shaders.volume.clone(),
        view: layouts.depth.clone(),
        field: field.clone(),
    });
}

impl SpecializedRenderPipeline for VolumePipeline {
    type Key = VolumeKey;

    fn specialize(&self, key: VolumeKey) -> RenderPipelineDescriptor {
        let mut definitions = field_definitions(key.shape, key.degree);
        if key.multisampled {
            definitions.push("MULTISAMPLED".into());
        }
        let over = |src_factor| BlendState {
            color: BlendComponent {
                src_factor,
                dst_factor: BlendFactor::OneMinusSrcAlpha,
                operation: BlendOperation::Add,
            },
            alpha: BlendComponent::OVER,
        };
        let target =
            |format, blend| Some(ColorTargetState { format, blend: Some(blend), write_mask: ColorWrites::ALL });
        RenderPipelineDescriptor {
            label: Some("plenoctree_volume".into()),
            layout: vec![self.view[usize::from(key.multisampled)].clone(), self.field.0.clone()],
            vertex: VertexState {
                shader: self.shader.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            depth_stencil: Some(depth_test(DEPTH_FORMAT, true, CompareFunction::GreaterEqual)),
            // Back faces: each pixel of the box once, also from inside it.
            primitive: PrimitiveState { cull_mode: Some(Face::Front), ..default() },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: vec![
                    target(LAYER_FORMAT, over(BlendFactor::One)),
                    // The nearest prop that is opaque enough owns the pixel.
                    target(OWNER_FORMAT, over(BlendFactor::SrcAlpha)),
                ],
            }),
            ..default()
        }
    }
}

/// The pipeline of every prop of a view, in drawing order.
#[derive(Component, Default)]
pub(super) struct VolumePipelines(Vec<CachedRenderPipelineId>);

pub(super) fn prepare_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    pipeline: Res<VolumePipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<VolumePipeline>>,
    fields: Res<RenderAssets<GpuField>>,
    views: Query<(Entity, &ViewProps, &Msaa)>,
) {
    for (entity, props, msaa) in &views {
        let levels = props.fields.iter().filter_map(|field| level(&fields, field));
        let ids = levels.map(|level| {
            let key = VolumeKey { shape: level.shape, degree: props.degree, multisampled: msaa.samples() > 1 };
            if props.changes_levels {
                // A level that is drawn next must not wait for its pipeline.
                let inner_records = !level.shape.inner_records;
                specialized.specialize(
                    &cache,
                    &pipeline,
                    VolumeKey { shape: FieldShape { inner_records, ..level.shape }, ..key },
                );
            }
            specialized.specialize(&cache, &pipeline, key)
        });
        commands.entity(entity).insert(VolumePipelines(ids.collect()));
    }
}

/// What a view draws of a field.
fn level<'a>(fields: &'a RenderAssets<GpuField>, (id, level): &(AssetId<PlenOctree>, Level)) -> Option<&'a GpuLevel> {
    fields.get(*id)?.level(*level).map(AsRef::as_ref)
}

/// The bind groups of one view.
#[derive(Component)]
pub(super) struct VolumeBindGroups {
    /// Bind group 0 of the pass.
    view: BindGroup,
    /// What the pass has drawn, if it must be brought to the size of the viewport.
    coarse: Option<BindGroup>,
}

pub(super) fn prepare_bind_groups(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    layouts: Res<ViewLayouts>,
    upsample: Res<UpsamplePipeline>,
    views: Query<(Entity, &ViewProps, &PropTextures, &ViewDepthTexture, &Msaa)>,
) {
    for (entity, props, textures, depth, msaa) in &views {
        let Some((view, list, colors)) = props.bindings() else {
            commands.entity(entity).remove::<VolumeBindGroups>();
            continue;
        };
        let layout = &layouts.depth[usize::from(msaa.samples() > 1)];
        let view = device.create_bind_group(
            "plenoctree_depth_view",
            &cache.get_bind_group_layout(layout),
            &BindGroupEntries::sequential((view, list, colors, depth.view())),
        );
        let coarse = textures.coarse.as_ref().map(|coarse| {
            device.create_bind_group(
                upsample.shared.label,
                &cache.get_bind_group_layout(&upsample.shared.layout),
                &BindGroupEntries::sequential((&coarse.color, &coarse.owner, &coarse.depth)),
            )
        });
        commands.entity(entity).insert(VolumeBindGroups { view, coarse });
    }
}

pub(super) fn volume_pass(
    view: ViewQuery<(&PropTextures, &ViewProps, &VolumePipelines, &VolumeBindGroups, &Msaa)>,
    cache: Res<PipelineCache>,
    upsample: Res<UpsamplePipeline>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, pipelines, groups, msaa) = view.into_inner();
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), VOLUME_SPAN);
    {
        let layer = textures.volume();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(VOLUME_SPAN),
            color_attachments: &[cleared(&layer.color), cleared(&layer.owner)],
            depth_stencil_attachment: Some(depth_attachment(&layer.depth)),
            ..default()
        });
        pass.set_bind_group(0, &groups.view, &[]);
        for (index, (field, pipeline)) in props.fields.iter().zip(&pipelines.0).enumerate() {
            let (Some(level), Some(pipeline)) = (level(&fields, field), cache.get_render_pipeline(*pipeline)) else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, &level.bind_group, &[]);
            let instance = index as u32;
            pass.draw(0..36, instance..instance + 1);
        }
    }
    if let (Some(group), Some(pipeline)) = (&groups.coarse, cache.get_render_pipeline(upsample.id(msaa))) {
        let layer = &textures.layer;
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(VOLUME_SPAN),
            color_attachments: &[cleared(&layer.color), cleared(&layer.owner)],
            depth_stencil_attachment: Some(depth_attachment(&layer.depth)),
            ..default()
        });
        let (corner, size) = (props.rect.min, props.rect.size());
        pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, &groups.view, &[]);
        pass.set_bind_group(1, group, &[]);
        pass.draw(0..3, 0..1);
    }
    span.end(ctx.command_encoder());
}

fn cleared(view: &TextureView) -> Option<RenderPassColorAttachment<'_>> {
    let attachment = onto(view)?;
    let ops = Operations { load: LoadOp::Clear(default()), store: StoreOp::Store };
    Some(RenderPassColorAttachment { ops, ..attachment })
}

fn depth_attachment(view: &TextureView) -> RenderPassDepthStencilAttachment<'_> {
    RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(Operations { load: LoadOp::Clear(0.0), store: StoreOp::Store }),
        stencil_ops: None,
    }
}
