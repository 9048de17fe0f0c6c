//! Runs the outline pass and the coverage pass.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_asset::RenderAssets,
        render_resource::{
            BindGroupEntries, CachedRenderPipelineId, PipelineCache, RenderPassDescriptor, SpecializedRenderPipelines,
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
    },
};

use super::{
    coverage::{CoverageKey, CoveragePipeline, Part},
    outline::OutlinePipeline,
    textures::EdgeTextures,
};
use crate::{
    gpu::GpuField,
    render::{
        attachment::{self, cleared, depth, tested},
        bind_group::KeptBindGroup,
        fullscreen::draw,
        kept::KeptView,
        view::{ViewBindGroups, ViewProps, ViewTextures},
    },
};

/// The name of the passes' span in Bevy's render diagnostics.
pub const EDGES_SPAN: &str = "plenoctree_edges";

/// The pipelines and bind groups of a view in which the edges of props are smooth.
#[derive(Component, Default)]
pub(in crate::render) struct EdgesPass {
    outline: Option<CachedRenderPipelineId>,
    /// What is drawn of every prop whose edges are smooth: the part, its index in drawing order, and its pipeline.
    coverage: Vec<(Part, usize, CachedRenderPipelineId)>,
    layer: KeptBindGroup,
    outlines: KeptBindGroup,
    places: KeptBindGroup,
}

impl EdgesPass {
    /// Returns whether all pipelines that the view needs have been created.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let ids = self.outline.iter().chain(self.coverage.iter().map(|(.., id)| id));
        ids.into_iter().all(|id| cache.get_render_pipeline(*id).is_some())
    }
}

/// Returns the parts in which the coverage of a view's props is drawn. Where props overlap, those before others are
/// compared with them ray by ray.
fn parts(props: &ViewProps) -> &'static [Part] {
    match props.drawn.len() {
        1 => &[Part::Alone],
        _ if props.has_overlaps() => &[Part::OfOwners, Part::OfOthers],
        _ => &[Part::All],
    }
}

pub(super) fn prepare_pipelines(
    cache: Res<PipelineCache>,
    mut outline: ResMut<OutlinePipeline>,
    coverage: Res<CoveragePipeline>,
    mut coverages: ResMut<SpecializedRenderPipelines<CoveragePipeline>>,
    fields: Res<RenderAssets<GpuField>>,
    mut views: Query<(&ViewProps, Option<&ViewTextures>, &Msaa, &mut EdgesPass)>,
) {
    for (props, textures, msaa, mut pass) in &mut views {
        pass.outline = None;
        pass.coverage.clear();
        if textures.is_none() || !props.smooths_edges() {
            continue;
        }
        let samples = msaa.samples();
        pass.outline = Some(outline.id(&cache, props.drawn.len() > 1));
        for part in parts(props) {
            let smooth = props.drawn.iter().enumerate().filter(|(_, prop)| prop.smooths_edges);
            pass.coverage.extend(smooth.filter_map(|(index, prop)| {
                let key = CoverageKey { shape: prop.on_gpu(&fields)?.shape, samples, part: *part };
                Some((*part, index, coverages.specialize(&cache, &coverage, key)))
            }));
        }
    }
}

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    outline: Res<OutlinePipeline>,
    coverage: Res<CoveragePipeline>,
    mut views: Query<(Option<(&ViewTextures, &EdgeTextures)>, &mut EdgesPass)>,
) {
    for (textures, mut pass) in &mut views {
        let Some((ViewTextures { layer, .. }, edges)) = textures else {
            (pass.layer, pass.outlines, pass.places) = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&layer.color, &layer.owner, &layer.depth));
        pass.layer.update(&device, &cache, outline.shared.label, &outline.shared.layout, &entries);
        let entries = BindGroupEntries::sequential((&edges.outline, &layer.owner, &layer.depth));
        pass.outlines.update(&device, &cache, coverage.label, &coverage.layout, &entries);
        let Some(places) = &edges.places else {
            pass.places = default();
            continue;
        };
        let entries = BindGroupEntries::sequential((&edges.outline, &layer.owner, &layer.depth, places));
        pass.places.update(&device, &cache, coverage.label, &coverage.layout_of_others, &entries);
    }
}

pub(super) fn edges_pass(
    view: ViewQuery<(&EdgeTextures, &ViewProps, &ViewBindGroups, &KeptView, &EdgesPass)>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    mut ctx: RenderContext,
) {
    let (textures, props, groups, kept, edges) = view.into_inner();
    let (Some(group), Some(plain), Some(layer), Some(outlines)) =
        (groups.with_depth.get(), groups.plain.get(), edges.layer.get(), edges.outlines.get())
    else {
        return;
    };
    // Until all pipelines are ready, nothing is marked and edges are hard.
    let pipelines: Option<Vec<_>> =
        edges.coverage.iter().map(|(part, index, id)| Some((*part, *index, cache.get_render_pipeline(*id)?))).collect();
    let outline = edges.outline.and_then(|id| cache.get_render_pipeline(id)).filter(|_| pipelines.is_some());
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), EDGES_SPAN);
    {
        let attachment = if kept.layer.is_drawn() { cleared } else { attachment::kept };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(EDGES_SPAN),
            color_attachments: &textures.targets().map(attachment)[..if props.drawn.len() > 1 { 4 } else { 1 }],
            depth_stencil_attachment: Some(depth(&textures.mask, kept.layer.is_drawn())),
            ..default()
        });
        if let Some(outline) = outline {
            draw(&mut pass, props, None, outline, [(plain, &[]), (layer, &[])]);
        }
    }
    let pipelines = pipelines.unwrap_or_default();
    for part in parts(props) {
        let [_, coverage, own, other] = textures.targets().map(attachment::kept);
        let (third, bound) = match (part, &textures.places, edges.places.get()) {
            (Part::Alone | Part::All, ..) => (other, outlines),
            (Part::OfOwners, Some(places), _) => (cleared(places), outlines),
            (Part::OfOthers, _, Some(places)) => (other, places),
            _ => continue,
        };
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(EDGES_SPAN),
            color_attachments: &[coverage, own, third],
            depth_stencil_attachment: Some(tested(&textures.mask)),
            ..default()
        });
        pass.set_bind_group(0, group, &[]);
        pass.set_bind_group(2, bound, &[]);
        for (_, index, pipeline) in pipelines.iter().filter(|(of, ..)| of == part) {
            let Some((prop, level)) = props.drawn.get(*index).and_then(|prop| Some((prop, prop.on_gpu(&fields)?)))
            else {
                continue;
            };
            // What is drawn alone replaces what was drawn before, of all pixels at edges.
            let rect = if *part == Part::Alone { props.rect } else { prop.rect };
            if rect.is_empty() {
                continue;
            }
            let (corner, size) = (rect.min, rect.size());
            pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(1, &level.bind_group, &[]);
            pass.draw(0..3, *index as u32..*index as u32 + 1);
        }
    }
    span.end(ctx.command_encoder());
}
