//! The compare pass: compares the scene with its copy.

use bevy::{
    prelude::*,
    render::{
        diagnostic::RecordDiagnostics,
        render_resource::{
            BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource,
            CachedComputePipelineId, ComputePassDescriptor, ComputePipelineDescriptor, PipelineCache, ShaderStages,
            TextureSampleType, TextureViewId,
            binding_types::{
                storage_buffer_sized, texture_2d, texture_depth_2d, texture_depth_2d_multisampled, uniform_buffer,
            },
        },
        renderer::{RenderContext, RenderDevice, ViewQuery},
        view::{ViewDepthTexture, ViewTarget},
    },
};

use super::prepare::KeptView;
use crate::{
    gpu::Shaders,
    render::{
        bind_group::KeptBindGroup,
        view::{ViewProps, ViewUniform},
    },
    stage::PropStage,
};

/// The names of the passes' spans in Bevy's render diagnostics.
pub const COMPARE_DEPTHS_SPAN: &str = "plenoctree_compare_depths";
pub const COMPARE_COLORS_SPAN: &str = "plenoctree_compare_colors";

/// The width and height of a workgroup.
const WORKGROUP: u32 = 8;

#[derive(Resource)]
pub(super) struct ComparePipelines {
    /// For the depth of a single-sampled scene, and of a multisampled one.
    depths: [Compare; 2],
    colors: Compare,
}

struct Compare {
    layout: BindGroupLayoutDescriptor,
    id: CachedComputePipelineId,
}

impl ComparePipelines {
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let [single, multisampled] = &self.depths;
        [single, multisampled, &self.colors].iter().all(|compare| cache.get_compute_pipeline(compare.id).is_some())
    }

    fn depths(&self, msaa: &Msaa) -> &Compare {
        &self.depths[usize::from(msaa.samples() > 1)]
    }
}

pub(super) fn init(mut commands: Commands, shaders: Res<Shaders>, cache: Res<PipelineCache>) {
    let compare = |scene, definition: Option<&str>| {
        let (view, buffer) = (uniform_buffer::<ViewUniform>(false), || storage_buffer_sized(false, None));
        let entries = BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (view, buffer(), buffer(), scene));
        let layout = BindGroupLayoutDescriptor::new(LABEL, &entries);
        let id = cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some(LABEL.into()),
            layout: vec![layout.clone()],
            shader: shaders.compare.clone(),
            shader_defs: definition.into_iter().map(Into::into).collect(),
            entry_point: Some("compare".into()),
            ..default()
        });
        Compare { layout, id }
    };
    commands.insert_resource(ComparePipelines {
        depths: [compare(texture_depth_2d(), None), compare(texture_depth_2d_multisampled(), Some("MULTISAMPLED"))],
        colors: compare(texture_2d(TextureSampleType::Float { filterable: false }), Some("COLORS")),
    });
}

const LABEL: &str = "plenoctree_compare";

/// The bind groups of a view.
#[derive(Default)]
pub(super) struct CompareGroups {
    depths: KeptBindGroup,
    /// One for each of the two main textures of its target.
    colors: [(Option<TextureViewId>, KeptBindGroup); 2],
}

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
        let [depths, colors] = copies;
        if let (Some(copy), Some((depth, msaa))) = (depths, depth) {
            let entries =
                BindGroupEntries::sequential((view.clone(), stale.clone(), copy.as_entire_binding(), depth.view()));
            groups.depths.update(&device, &cache, LABEL, &pipelines.depths(msaa).layout, &entries);
        }
        if let (Some(copy), Some(target)) = (colors, target) {
            let scenes = [target.main_texture_view(), target.main_texture_other_view()];
            for ((id, group), scene) in groups.colors.iter_mut().zip(scenes) {
                *id = Some(scene.id());
                let copy: BindingResource = copy.as_entire_binding();
                let entries = BindGroupEntries::sequential((view.clone(), stale.clone(), copy, scene));
                group.update(&device, &cache, LABEL, &pipelines.colors.layout, &entries);
            }
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
    if kept.layer.reads_scene() {
        let group = kept.groups.depths.get();
        compare(&mut ctx, COMPARE_DEPTHS_SPAN, &cache, pipelines.depths(msaa), group, props);
    }
    // The passes that draw the layer follow without fail, but those that draw the composite may wait for their pipelines.
    kept.layer.finish();
    kept.composite.begin();
}

pub(super) fn compare_colors(
    InMut(stage): InMut<PropStage>,
    view: ViewQuery<(&mut KeptView, &ViewProps, &ViewTarget)>,
    cache: Res<PipelineCache>,
    pipelines: Res<ComparePipelines>,
    mut ctx: RenderContext,
) {
    let (mut kept, props, target) = view.into_inner();
    if !props.posterizes_at(*stage, &cache) {
        return;
    }
    if kept.composite.reads_scene() {
        let scene = target.main_texture_view().id();
        let group = kept.groups.colors.iter().find(|(id, _)| *id == Some(scene));
        let group = group.and_then(|(_, group)| group.get());
        compare(&mut ctx, COMPARE_COLORS_SPAN, &cache, &pipelines.colors, group, props);
    }
    kept.composite.finish();
}

fn compare(
    ctx: &mut RenderContext,
    span: &'static str,
    cache: &PipelineCache,
    compare: &Compare,
    group: Option<&BindGroup>,
    props: &ViewProps,
) {
    let (Some(group), Some(pipeline)) = (group, cache.get_compute_pipeline(compare.id)) else {
        return;
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span_guard = diagnostics.time_span(ctx.command_encoder(), span);
    {
        let descriptor = ComputePassDescriptor { label: Some(span), timestamp_writes: None };
        let mut pass = ctx.command_encoder().begin_compute_pass(&descriptor);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        let groups = props.rect.size().map(|pixels| pixels.div_ceil(WORKGROUP));
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    }
    span_guard.end(ctx.command_encoder());
}
