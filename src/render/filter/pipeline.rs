//! The pipelines of the filter, one for each direction.

use bevy::{
    prelude::*,
    render::{
        render_resource::{
            BindGroupLayoutDescriptor, BindGroupLayoutEntries, Buffer, BufferInitDescriptor, BufferUsages,
            CachedRenderPipelineId, PipelineCache, ShaderStages, binding_types::uniform_buffer,
        },
        renderer::RenderDevice,
    },
    shader::ShaderDefVal,
};

use crate::{
    gpu::{Shaders, WordTextures},
    posterize::MAX_FILTER_ITERATIONS,
    render::{
        composite::COMPOSITE_FORMAT,
        fullscreen::{Fullscreen, props_test, target},
        kept::KeptPart,
        view::ViewLayouts,
    },
};

/// The distance between two values in the buffer of iterations, in bytes. No device requires a larger alignment.
pub(super) const ITERATION_STRIDE: u32 = 256;

/// The pipelines of the filter, and the resources that they share.
#[derive(Resource)]
pub(super) struct FilterPipelines {
    pub label: &'static str,
    pub layout: BindGroupLayoutDescriptor,
    pub horizontal: CachedRenderPipelineId,
    pub vertical: CachedRenderPipelineId,
    /// The numbers 0, 1, 2, ..., one every [`ITERATION_STRIDE`] bytes.
    pub iterations: Buffer,
}

pub(super) fn init(
    mut commands: Commands,
    views: Res<ViewLayouts>,
    words: Res<WordTextures>,
    shaders: Res<Shaders>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let entries = BindGroupLayoutEntries::sequential(
        ShaderStages::FRAGMENT,
        (words.entry(COMPOSITE_FORMAT), uniform_buffer::<UVec4>(true)),
    );
    let filter = Fullscreen::new("plenoctree_filter", &shaders.filter, &entries, &shaders, &views)
        .unless_kept(KeptPart::Composite);
    let direction = |mut definitions: Vec<ShaderDefVal>| {
        definitions.extend(words.definitions());
        let mut descriptor = filter.pipeline(definitions, &[target(COMPOSITE_FORMAT, None)]);
        descriptor.depth_stencil = Some(props_test());
        cache.queue_render_pipeline(descriptor)
    };
    let mut words = vec![0u32; (MAX_FILTER_ITERATIONS * ITERATION_STRIDE / 4) as usize];
    for (iteration, value) in words.chunks_exact_mut(ITERATION_STRIDE as usize / 4).enumerate() {
        value[0] = iteration as u32;
    }
    commands.insert_resource(FilterPipelines {
        horizontal: direction(vec!["HORIZONTAL".into()]),
        vertical: direction(vec![]),
        label: filter.label,
        layout: filter.layout,
        iterations: device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("plenoctree_iterations"),
            contents: bytemuck::cast_slice(&words),
            usage: BufferUsages::UNIFORM,
        }),
    });
}
