//! The compare pass: compares the scene with its copy.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedRenderPipelineId, FragmentState,
            PipelineCache, RenderPassDescriptor, RenderPipelineDescriptor, ShaderStages, TextureFormat,
            TextureSampleType, TextureView, VertexState,
            binding_types::{
                storage_buffer_sized, texture_2d, texture_depth_2d, texture_depth_2d_multisampled, uniform_buffer,
            },
        },
        renderer::{RenderAdapter, RenderContext, RenderDevice, ViewQuery},
        view::{ViewDepthTexture, ViewTarget},
    },
};

use super::{copy::SceneCopy, view::KeptView};
use crate::{
    gpu::Shaders,
    render::{
        attachment::kept,
        bind_group::KeptBindGroup,
        fullscreen::target,
        view::{ViewProps, ViewUniform},
    },
    stage::PropStage,
};

/// The names of the passes' spans in Bevy's render diagnostics.
pub const COMPARE_DEPTHS_SPAN: &str = "plenoctree_compare_depths";
pub const COMPARE_COLORS_SPAN: &str = "plenoctree_compare_colors";

/// The formats of the copies of the scene's depth and of its colors.
pub(super) const COPY_FORMATS: [TextureFormat; 2] = [TextureFormat::R32Uint, TextureFormat::Rg32Uint];

#[derive(Resource)]
pub(super) struct ComparePipelines {
    /// For the depth of a single-sampled scene, and of a multisampled one.
    depths: [Compare; 2],
    colors: Compare,
    /// Whether the device can set a flag from a fragment shader.
    are_supported: bool,
}

struct Compare {
    layout: BindGroupLayoutDescriptor,
    id: CachedRenderPipelineId,
}

impl ComparePipelines {
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let [single, multisampled] = &self.depths;
        let is_ready = |compare: &Compare| cache.get_render_pipeline(compare.id).is_some();
        self.are_supported && [single, multisampled, &self.colors].into_iter().all(is_ready)
    }

    fn depths(&self, msaa: &Msaa) -> &Compare {
        &self.depths[usize::from(msaa.samples() > 1)]
    }
}

pub(super) fn init(
    mut commands: Commands,
    adapter: Res<RenderAdapter>,
    shaders: Res<Shaders>,
    cache: Res<PipelineCache>,
) {
    let compare = |scene, format, definition: Option<&str>| {
        let (view, stale) = (uniform_buffer::<ViewUniform>(false), storage_buffer_sized(false, None));
        let before = texture_2d(TextureSampleType::Uint);
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, (view, stale, before, scene));
        let layout = BindGroupLayoutDescriptor::new(LABEL, &entries);
        let id = cache.queue_render_pipeline(RenderPipelineDescriptor {
            label: Some(LABEL.into()),
            layout: vec![layout.clone()],
            vertex: VertexState {
                shader: shaders.compare.clone(),
                shader_defs: definition.into_iter().map(Into::into).collect(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            fragment: Some(FragmentState {
                shader: shaders.compare.clone(),
                shader_defs: definition.into_iter().map(Into::into).collect(),
                entry_point: Some("fragment".into()),
                targets: vec![Some(target(format, None))],
            }),
            ..default()
        });
        Compare { layout, id }
    };
    let [depth, color] = COPY_FORMATS;
    let needed = wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE;
    commands.insert_resource(ComparePipelines {
        depths: [
            compare(texture_depth_2d(), depth, None),
            compare(texture_depth_2d_multisampled(), depth, Some("MULTISAMPLED")),
        ],
        colors: compare(texture_2d(TextureSampleType::Float { filterable: false }), color, Some("COLORS")),
        are_supported: adapter.get_downlevel_capabilities().flags.contains(needed),
    });
}

const LABEL: &str = "plenoctree_compare";

pub(super) fn prepare_bind_groups(
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    pipelines: Res<ComparePipelines>,
    mut views: Query<(Option<(&ViewDepthTexture, &Msaa)>, Option<&ViewTarget>, &ViewProps, &mut KeptView)>,
) {
    for (depth, target, props, mut kept) in &mut views {
        let KeptView { copies, groups, stale, .. } = &mut *kept;
        let (Some(view), Some(stale)) = (props.view.binding(), stale.as_ref().and_then(|stale| stale.binding())) else {
            continue;
        };
        let update = |groups: &mut [KeptBindGroup; 2], compare: &Compare, copy: &SceneCopy, scene: &TextureView| {
            for (group, before) in groups.iter_mut().zip(copy.views()) {
                let entries = BindGroupEntries::sequential((view.clone(), stale.clone(), before, scene));
                group.update(&device, &cache, LABEL, &compare.layout, &entries);
            }
        };
        let [depths, colors] = copies;
        if let (Some(copy), Some((depth, msaa))) = (depths, depth) {
            update(&mut groups.depths, pipelines.depths(msaa), copy, depth.view());
        }
        if let (Some(copy), Some(target)) = (colors, target) {
            groups.colors.update(target, |groups, scene| update(groups, &pipelines.colors, copy, scene));
        }
    }
}

pub(super) fn compare_depths(
    view: ViewQuery<(&mut KeptView, &ViewProps, &Msaa)>,
    cache: Res<PipelineCache>,
    pipelines: Res<ComparePipelines>,
    mut ctx: RenderContext,
) {
    let (mut kept, props, msaa) = view.into_inner();
    let KeptView { layer, composite, labels, copies: [copy, _], groups, .. } = &mut *kept;
    if layer.reads_scene() {
        compare(&mut ctx, COMPARE_DEPTHS_SPAN, &cache, pipelines.depths(msaa), &groups.depths, copy, props);
    }
    // The passes that draw the layer follow without fail, but those that draw the composite may wait for their
    // pipelines.
    layer.finish();
    composite.begin();
    labels.begin();
}

pub(super) fn compare_colors(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(&mut KeptView, &ViewProps, &ViewTarget)>,
    cache: Res<PipelineCache>,
    pipelines: Res<ComparePipelines>,
    mut ctx: RenderContext,
) {
    let (mut kept, props, target) = view.into_inner();
    if !props.is_shown_at(*stage, &cache) {
        return;
    }
    let KeptView { composite, labels, copies: [_, copy], groups, .. } = &mut *kept;
    if let Some(groups) = groups.colors.get(target).filter(|_| composite.reads_scene()) {
        compare(&mut ctx, COMPARE_COLORS_SPAN, &cache, &pipelines.colors, groups, copy, props);
    }
    composite.finish();
    labels.finish();
}

fn compare(
    ctx: &mut RenderContext,
    span: &'static str,
    cache: &PipelineCache,
    compare: &Compare,
    groups: &[KeptBindGroup; 2],
    copy: &mut Option<SceneCopy>,
    props: &ViewProps,
) {
    let Some(copy) = copy else { return };
    let (Some(group), Some(pipeline)) = (groups[copy.latest()].get(), cache.get_render_pipeline(compare.id)) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let guard = diagnostics.time_span(ctx.command_encoder(), span);
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(span),
            color_attachments: &[kept(copy.swap())],
            ..default()
        });
        let (corner, size) = (props.rect.min, props.rect.size());
        pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
        pass.set_render_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }
    guard.end(ctx.command_encoder());
}
