//! Draws the boxes of props that overlap and may be solid.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines},
        renderer::{RenderContext, ViewQuery},
    },
};

use super::{
    pipeline::{SolidKey, SolidPipeline},
    textures::{SolidBindGroups, SolidTextures},
};
use crate::{
    gpu::GpuField,
    render::{
        attachment::{self, cleared, depth},
        boxes::BOX_VERTICES,
        extract::{ExtractedProps, VisibleProps},
        kept::{ClearPipelines, Cleared, KeptView},
        view::{Overlap, ViewBindGroups, ViewProps},
    },
};

/// The name of the pass's span in Bevy's render diagnostics.
pub const SOLID_SPAN: &str = "plenoctree_solid";

/// The pipelines of every prop of a view that the pass draws, in drawing order: for both rounds.
#[derive(Component, Default)]
pub(in crate::render) struct SolidPipelines(Vec<Option<[CachedRenderPipelineId; 2]>>);

impl SolidPipelines {
    /// Returns whether all of them have been created.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        self.0.iter().flatten().flatten().all(|id| cache.get_render_pipeline(*id).is_some())
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<SolidPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<SolidPipeline>>,
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    mut views: Query<(&VisibleProps, &ViewProps, &Msaa, &mut SolidPipelines)>,
) {
    for (visible, props, msaa, mut pipelines) in &mut views {
        let multisampled = msaa.samples() > 1;
        let mut of = |inner_records| {
            [false, true].map(|second_round| {
                specialized.specialize(&cache, &pipeline, SolidKey { inner_records, multisampled, second_round })
            })
        };
        if visible.props.len() > 1 {
            extracted.arriving_shapes(&visible.props, &fields).for_each(|(shape, _)| _ = of(shape.inner_records));
        }
        pipelines.0.clear();
        pipelines.0.extend(props.drawn.iter().map(|prop| {
            let level = prop.on_gpu(&fields).filter(|_| prop.overlap == Overlap::Solid)?;
            Some(of(level.shape.inner_records))
        }));
    }
}

pub(super) fn solid_pass(
    view: ViewQuery<(&SolidTextures, &ViewProps, &ViewBindGroups, &KeptView, &SolidBindGroups, &SolidPipelines)>,
    cache: Res<PipelineCache>,
    clear: Res<ClearPipelines>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, solid, pipelines) = view.into_inner();
    let (Some(group), Some(plain), Some(first)) = (groups.with_depth.get(), groups.plain.get(), solid.first.get())
    else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), SOLID_SPAN);
    let clears = kept.layer.is_drawn();
    for (round, target) in [&textures.nearest, &textures.opaque].into_iter().enumerate() {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(SOLID_SPAN),
            color_attachments: &[if clears { cleared(&target.prop) } else { attachment::kept(&target.prop) }],
            depth_stencil_attachment: Some(depth(&target.depth, clears)),
            ..default()
        });
        if !clears {
            clear.draw(&mut pass, &cache, plain, Cleared::Solid);
        }
        pass.set_bind_group(0, group, &[]);
        if round > 0 {
            pass.set_bind_group(2, first, &[]);
        }
        // Front to back: of equal depths, the first one stays.
        for (index, (prop, pipelines)) in props.drawn.iter().zip(&pipelines.0).enumerate().rev() {
            let pipeline = pipelines.and_then(|ids| cache.get_render_pipeline(ids[round]));
            let (Some(level), Some(pipeline)) = (prop.on_gpu(&fields), pipeline) else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, &level.bind_group, &[]);
            let instance = index as u32;
            pass.draw(0..BOX_VERTICES, instance..instance + 1);
        }
    }
    span.end(ctx.command_encoder());
}
