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

use super::pipeline::{VolumeKey, VolumePipeline};
use crate::{
    gpu::{FieldShape, GpuField},
    render::{
        attachment::depth,
        boxes,
        extract::{ExtractedProps, VisibleProps},
        kept::{ClearPipelines, Cleared, KeptView},
        refine::RaysOf,
        solid::SolidBindGroups,
        view::{DrawnProp, Overlap, ViewBindGroups, ViewProps, ViewTextures},
    },
    stage::PropStage,
};

/// The names of the pass's spans in Bevy's render diagnostics.
pub const VOLUME_SPAN: &str = "plenoctree_volume";
pub const BATCHES_SPAN: &str = "plenoctree_volume_batches";

/// The pipelines of every prop of a view, in drawing order.
#[derive(Component, Default)]
pub(in crate::render) struct VolumePipelines(Vec<Option<Pipelines>>);

struct Pipelines {
    grid: CachedRenderPipelineId,
    batches: Option<CachedRenderPipelineId>,
}

impl VolumePipelines {
    /// Returns whether all of them have been created.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let ids = self.0.iter().flatten().flat_map(|pipelines| [Some(pipelines.grid), pipelines.batches]);
        ids.flatten().all(|id| cache.get_render_pipeline(id).is_some())
    }
}

/// The parts of props that overlap, in drawing order. They match `volume.wgsl`.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// What is behind the solid depth, where it shows through.
    Behind,
    /// All of the prop that is solid there.
    Solid,
    /// What is in front of the solid depth, or everything if there is none.
    Before,
}

impl Part {
    /// Returns whether a prop may have this part. Props that do not overlap others are drawn in one piece.
    fn is_of(self, prop: &DrawnProp) -> bool {
        match self {
            Self::Behind => prop.overlap != Overlap::None,
            Self::Solid => prop.overlap == Overlap::Solid,
            Self::Before => true,
        }
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    pipeline: Res<VolumePipeline>,
    mut specialized: ResMut<SpecializedRenderPipelines<VolumePipeline>>,
    extracted: Res<ExtractedProps>,
    fields: Res<RenderAssets<GpuField>>,
    mut views: Query<(&VisibleProps, &ViewProps, Option<&ViewTextures>, &Msaa, &mut VolumePipelines)>,
) {
    for (visible, props, textures, msaa, mut pipelines) in &mut views {
        let multisampled = msaa.samples() > 1;
        let is_sparse = textures.is_some_and(|textures| textures.sparse.is_some());
        let mut specialize = |key| Pipelines {
            grid: specialized.specialize(&cache, &pipeline, key),
            batches: is_sparse
                .then(|| specialized.specialize(&cache, &pipeline, VolumeKey { rays: RaysOf::Batches, ..key })),
        };
        // Compile the pipelines of fields that are arriving, so that the fields can be drawn as soon as they have
        // arrived.
        for (shape, is_lit) in extracted.arriving_shapes(&visible.props, &fields) {
            for overlapping in [false, visible.props.len() > 1] {
                let lit = is_lit && visible.stage == PropStage::Scene;
                let (rays, motion) = (RaysOf::Grid, visible.has_motion);
                specialize(VolumeKey { shape, rays, multisampled, overlapping, lit, motion });
            }
        }
        pipelines.0.clear();
        pipelines.0.extend(props.drawn.iter().map(|prop| {
            let shape = prop.on_gpu(&fields)?.shape;
            let key = VolumeKey {
                shape,
                rays: RaysOf::Grid,
                multisampled,
                overlapping: prop.overlap != Overlap::None,
                lit: prop.lit.is_some(),
                motion: visible.has_motion,
            };
            if props.changes_levels {
                // Also specialize the other variant, so that a change of level does not wait for its pipeline.
                let shape = FieldShape { inner_records: !shape.inner_records, ..shape };
                specialize(VolumeKey { shape, ..key });
            }
            Some(specialize(key))
        }));
    }
}

pub(super) fn volume_pass(
    InMut(rays): InMut<RaysOf>,
    view: ViewQuery<(&ViewTextures, &ViewProps, &ViewBindGroups, &KeptView, &SolidBindGroups, &VolumePipelines)>,
    cache: Res<PipelineCache>,
    clear: Res<ClearPipelines>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, solid, pipelines) = view.into_inner();
    let (Some(layer), Some(group), Some(plain)) = (textures.volume(*rays), groups.marching(*rays), groups.plain.get())
    else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let label = match rays {
        RaysOf::Grid => VOLUME_SPAN,
        RaysOf::Batches => BATCHES_SPAN,
    };
    let span = diagnostics.time_span(ctx.command_encoder(), label);
    {
        let clears = kept.layer.is_drawn();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(label),
            color_attachments: &layer.attachments(clears),
            depth_stencil_attachment: Some(depth(&layer.depth, clears)),
            ..default()
        });
        if !clears {
            let what = if layer.motion.is_some() { Cleared::LayerWithMotion } else { Cleared::Layer };
            clear.draw(&mut pass, &cache, plain, what);
        }
        pass.set_bind_group(0, group, &[]);
        let mut parts = [Part::Before].as_slice();
        if let Some(solid) = solid.of(*rays).both.get() {
            pass.set_bind_group(2, solid, &[]);
            parts = &[Part::Behind, Part::Solid, Part::Before];
        }
        for part in parts {
            for (index, (prop, pipeline)) in props.drawn.iter().zip(&pipelines.0).enumerate() {
                let id = pipeline.as_ref().filter(|_| part.is_of(prop)).and_then(|pipelines| match rays {
                    RaysOf::Grid => Some(pipelines.grid),
                    RaysOf::Batches => pipelines.batches,
                });
                let pipeline = id.and_then(|id| cache.get_render_pipeline(id));
                let (Some(level), Some(pipeline)) = (prop.on_gpu(&fields), pipeline) else {
                    continue;
                };
                pass.set_render_pipeline(pipeline);
                pass.set_bind_group(1, &level.bind_group, &[]);
                boxes::draw(&mut pass, *rays, props, prop, index as u32 | (*part as u32) << 16);
            }
        }
    }
    span.end(ctx.command_encoder());
}
