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
    gpu::{GpuField, TreeShape},
    render::{
        attachment::{self, cleared, depth},
        boxes,
        extract::{ExtractedProps, VisibleProps},
        kept::{ClearPipelines, Cleared, KeptView},
        refine::RaysOf,
        view::{Overlap, ViewBindGroups, ViewProps},
    },
};

/// The names of the pass's spans in Bevy's render diagnostics.
pub const SOLID_SPAN: &str = "plenoctree_solid";
pub const SOLID_BATCHES_SPAN: &str = "plenoctree_solid_batches";

/// The pipelines of every prop of a view that the pass draws, in drawing order.
#[derive(Component, Default)]
pub(in crate::render) struct SolidPipelines(Vec<Option<Pipelines>>);

/// The pipelines of a prop, for both rounds.
struct Pipelines {
    grid: [CachedRenderPipelineId; 2],
    batches: Option<[CachedRenderPipelineId; 2]>,
}

impl SolidPipelines {
    /// Returns whether all of them have been created.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let ids = self.0.iter().flatten().flat_map(|pipelines| [Some(pipelines.grid), pipelines.batches]);
        ids.flatten().flatten().all(|id| cache.get_render_pipeline(id).is_some())
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<SolidPipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<SolidPipeline>>,
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    mut views: Query<(&VisibleProps, &ViewProps, Option<&SolidTextures>, &Msaa, &mut SolidPipelines)>,
) {
    for (visible, props, textures, msaa, mut pipelines) in &mut views {
        let multisampled = msaa.samples() > 1;
        let is_sparse = textures.is_some_and(|textures| textures.batches.is_some());
        let mut of = |tree: TreeShape| {
            let mut rounds = |rays| {
                [false, true].map(|second_round| {
                    let key = SolidKey { tree, rays, multisampled, second_round };
                    specialized.specialize(&cache, &pipeline, key)
                })
            };
            Pipelines { grid: rounds(RaysOf::Grid), batches: is_sparse.then(|| rounds(RaysOf::Batches)) }
        };
        if visible.props.len() > 1 {
            extracted.arriving_shapes(&visible.props, &fields).for_each(|(shape, _)| _ = of(shape.into()));
        }
        pipelines.0.clear();
        pipelines.0.extend(props.drawn.iter().map(|prop| {
            let level = prop.on_gpu(&fields).filter(|_| prop.overlap == Overlap::Solid)?;
            Some(of(level.shape.into()))
        }));
    }
}

pub(super) fn solid_pass(
    InMut(rays): InMut<RaysOf>,
    view: ViewQuery<(&SolidTextures, &ViewProps, &ViewBindGroups, &KeptView, &SolidBindGroups, &SolidPipelines)>,
    cache: Res<PipelineCache>,
    clear: Res<ClearPipelines>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, solid, pipelines) = view.into_inner();
    let (Some(rounds), Some(group), Some(plain), Some(first)) =
        (textures.rounds(*rays), groups.marching(*rays), groups.plain.get(), solid.of(*rays).first.get())
    else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let label = match rays {
        RaysOf::Grid => SOLID_SPAN,
        RaysOf::Batches => SOLID_BATCHES_SPAN,
    };
    let span = diagnostics.time_span(ctx.command_encoder(), label);
    let clears = kept.layer.is_drawn();
    for (round, target) in [&rounds.nearest, &rounds.opaque].into_iter().enumerate() {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(label),
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
            let ids = pipelines.as_ref().and_then(|pipelines| match rays {
                RaysOf::Grid => Some(pipelines.grid),
                RaysOf::Batches => pipelines.batches,
            });
            let pipeline = ids.and_then(|ids| cache.get_render_pipeline(ids[round]));
            let (Some(level), Some(pipeline)) = (prop.on_gpu(&fields), pipeline) else {
                continue;
            };
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, &level.bind_group, &[]);
            boxes::draw(&mut pass, *rays, props, prop, index as u32);
        }
    }
    span.end(ctx.command_encoder());
}
