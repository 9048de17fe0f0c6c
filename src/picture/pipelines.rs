//! The pipelines of the posterize pass.

use bevy::{
    camera::CompositingSpace,
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_resource::{
            BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent, BlendState, Buffer,
            BufferInitDescriptor, BufferUsages, CachedRenderPipelineId, ColorTargetState, ColorWrites, CompareFunction,
            DepthStencilState, FragmentState, PipelineCache, RenderPipelineDescriptor, ShaderStages,
            SpecializedRenderPipeline, SpecializedRenderPipelines, TextureFormat, TextureSampleType, VertexState,
            binding_types::{texture_2d, texture_depth_2d, uniform_buffer},
        },
        renderer::RenderDevice,
        view::ExtractedView,
    },
    shader::{Shader, ShaderDefVal},
};

use super::{
    textures::{DEPTH_FORMAT, FILTERED_FORMAT, LAYER_FORMAT, OWNER_FORMAT},
    view::{ViewLayouts, ViewProps},
};
use crate::{gpu::Shaders, prop::MAX_FILTER_ITERATIONS, view::PropStage};

/// Distance of two values in the buffer of iterations: no device asks for more.
pub(super) const ITERATION_STRIDE: u32 = 256;

/// Lays the props over what was drawn before them.
#[derive(Resource)]
pub(super) struct CompositePipeline(pub Fullscreen);

/// The bilateral filter.
#[derive(Resource)]
pub(super) struct FilterPipelines {
    pub layout: BindGroupLayoutDescriptor,
    pub horizontal: CachedRenderPipelineId,
    pub vertical: CachedRenderPipelineId,
    /// 0, 1, 2, ... at distances of [`ITERATION_STRIDE`].
    pub iterations: Buffer,
}

/// Writes labels, and what is not posterized.
#[derive(Resource)]
pub(super) struct LabelPipeline(pub Fullscreen);

/// Writes the props' depth, after the labels.
#[derive(Resource)]
pub(super) struct DepthPipeline(pub Fullscreen);

/// Brings the layer of a coarser volume pass to the size of the viewport.
#[derive(Resource)]
pub(super) struct UpsamplePipeline {
    pub shared: Fullscreen,
    /// One sample a pixel, multisampled.
    ids: [CachedRenderPipelineId; 2],
}

impl UpsamplePipeline {
    /// The pipeline that reads a scene with so many samples a pixel.
    pub fn id(&self, msaa: &Msaa) -> CachedRenderPipelineId {
        self.ids[usize::from(msaa.samples() > 1)]
    }
}

/// What the pipelines of the pass have in common: a triangle over the viewport, and the view's bind group first.
pub(super) struct Fullscreen {
    pub label: &'static str,
    vertex: Handle<Shader>,
    fragment: Handle<Shader>,
    view: BindGroupLayoutDescriptor,
    pub layout: BindGroupLayoutDescriptor,
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

/// How a pipeline tests and writes depth. What is nearer has the greater value.
pub(super) fn depth_test(format: TextureFormat, writes: bool, compare: CompareFunction) -> DepthStencilState {
    DepthStencilState {
        format,
        depth_write_enabled: Some(writes),
        depth_compare: Some(compare),
        stencil: default(),
        bias: default(),
    }
}

/// The definitions that `target.wgsl` needs.
fn target_definitions(space: Option<CompositingSpace>) -> Vec<ShaderDefVal> {
    match space {
        Some(CompositingSpace::Srgb) => vec!["SRGB_TARGET".into()],
        Some(CompositingSpace::Oklab) => vec!["OKLAB_TARGET".into()],
        Some(CompositingSpace::Linear) | None => vec![],
    }
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    shaders: Res<Shaders>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let picture = || texture_2d(TextureSampleType::Float { filterable: false });
    let filtered = || texture_2d(TextureSampleType::Uint);
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
        &BindGroupLayoutEntries::sequential(stages, (picture(), texture_depth_2d())),
    )));
    commands.insert_resource(LabelPipeline(fullscreen(
        "plenoctree_label",
        &shaders.posterize,
        &BindGroupLayoutEntries::sequential(stages, (filtered(), picture())),
    )));

    let upsample = fullscreen(
        "plenoctree_upsample",
        &shaders.upsample,
        &BindGroupLayoutEntries::sequential(stages, (picture(), picture(), texture_depth_2d())),
    );
    let ids = [(0, None), (1, Some("MULTISAMPLED"))].map(|(samples, definition)| {
        let definitions = definition.into_iter().map(Into::into).collect();
        let targets = [target(LAYER_FORMAT, None), target(OWNER_FORMAT, None)];
        let mut descriptor = upsample.pipeline(definitions, &targets);
        descriptor.layout[0] = views.depth[samples].clone();
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, true, CompareFunction::Always));
        cache.queue_render_pipeline(descriptor)
    });
    commands.insert_resource(UpsamplePipeline { shared: upsample, ids });

    let filter = fullscreen(
        "plenoctree_filter",
        &shaders.bilateral,
        &BindGroupLayoutEntries::sequential(stages, (filtered(), uniform_buffer::<UVec4>(true))),
    );
    let direction = |definitions| {
        let mut descriptor = filter.pipeline(definitions, &[target(FILTERED_FORMAT, None)]);
        // Where no prop is, `fullscreen.wgsl` is behind the depth that was cleared: no work for the fragment shader.
        descriptor.depth_stencil = Some(depth_test(DEPTH_FORMAT, false, CompareFunction::LessEqual));
        cache.queue_render_pipeline(descriptor)
    };
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
    /// What the view's target stores, and whether the filter reads the picture.
    type Key = (Option<CompositingSpace>, bool);

    fn specialize(&self, (space, filtered): Self::Key) -> RenderPipelineDescriptor {
        let mut definitions = target_definitions(space);
        if !filtered {
            definitions.push("UNFILTERED".into());
        }
        let pictures = if filtered { 2 } else { 1 };
        self.0.pipeline(definitions, &vec![target(FILTERED_FORMAT, None); pictures])
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct LabelKey {
    format: TextureFormat,
    samples: u32,
    space: Option<CompositingSpace>,
}

impl SpecializedRenderPipeline for LabelPipeline {
    type Key = LabelKey;

    fn specialize(&self, key: LabelKey) -> RenderPipelineDescriptor {
        // The color is composited already; only what the target knows of opacity is added to.
        let blend = BlendState { color: BlendComponent::REPLACE, alpha: BlendComponent::OVER };
        let mut descriptor = self.0.pipeline(target_definitions(key.space), &[target(key.format, Some(blend))]);
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
        descriptor.depth_stencil = Some(depth_test(CORE_3D_DEPTH_FORMAT, true, CompareFunction::Greater));
        descriptor
    }
}

/// The pipelines of one view.
#[derive(Component)]
pub(super) struct PosterizePipelines {
    pub composite: CachedRenderPipelineId,
    pub label: CachedRenderPipelineId,
    pub depth: CachedRenderPipelineId,
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
    views: Query<(Entity, &ExtractedView, &ExtractedCamera, &Msaa, &ViewProps)>,
) {
    for (entity, view, camera, msaa, props) in &views {
        let space = camera.compositing_space;
        let samples = match props.stage {
            PropStage::Scene => msaa.samples(),
            PropStage::Display => 1,
        };
        let key = LabelKey { format: view.target_format, samples, space };
        commands.entity(entity).insert(PosterizePipelines {
            composite: composites.specialize(&cache, &composite, (space, props.iterations > 0)),
            label: labels.specialize(&cache, &label, key),
            depth: depths.specialize(&cache, &depth, msaa.samples()),
        });
    }
}
