//! Draws the box around each prop's leaves. The fragment shader marches through the leaves.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines},
        renderer::{RenderContext, ViewQuery},
    },
};
use plenoctree::PlenOctree;

use super::pipeline::{VolumeKey, VolumePipeline};
use crate::{
    gpu::{FieldShape, GpuField, GpuLevel, Level},
    render::{
        attachment::{cleared, cleared_depth},
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const VOLUME_SPAN: &str = "plenoctree_volume";

/// The pipeline of every prop of a view, in drawing order.
#[derive(Component, Default)]
pub(super) struct VolumePipelines(Vec<CachedRenderPipelineId>);

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<VolumePipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<VolumePipeline>>,
    fields: Res<RenderAssets<GpuField>>,
    mut views: Query<(&ViewProps, &Msaa, &mut VolumePipelines)>,
) {
    for (props, msaa, mut pipelines) in &mut views {
        pipelines.0.clear();
        pipelines.0.extend(props.fields.iter().filter_map(|field| level(&fields, field)).map(|level| {
            let key = VolumeKey { shape: level.shape, degree: props.degree, multisampled: msaa.samples() > 1 };
            if props.changes_levels {
                // Also specialize the other variant, so that a change of level does not wait for its pipeline.
                let inner_records = !level.shape.inner_records;
                let shape = FieldShape { inner_records, ..level.shape };
                specialized.specialize(&cache, &pipeline, VolumeKey { shape, ..key });
            }
            specialized.specialize(&cache, &pipeline, key)
        }));
    }
}

/// Returns the level of a field that a view draws.
fn level<'a>(fields: &'a RenderAssets<GpuField>, (id, level): &(AssetId<PlenOctree>, Level)) -> Option<&'a GpuLevel> {
    fields.get(*id)?.level(*level).map(AsRef::as_ref)
}

pub(super) fn volume_pass(
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &VolumePipelines)>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, pipelines) = view.into_inner();
    let Some(group) = groups.with_depth.get() else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), VOLUME_SPAN);
    {
        let layer = textures.volume();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(VOLUME_SPAN),
            color_attachments: &[cleared(&layer.color), cleared(&layer.owner)],
            depth_stencil_attachment: Some(cleared_depth(&layer.depth)),
            ..default()
        });
        pass.set_bind_group(0, group, &[]);
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
    span.end(ctx.command_encoder());
}
