//! Decides what each view draws anew, as far as that is known before the scene is drawn.

use bevy::{
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_asset::RenderAssets,
        render_resource::{
            BindingResource, Buffer, BufferDescriptor, BufferUsages, PipelineCache, ShaderType, UniformBuffer,
        },
        renderer::{RenderDevice, RenderQueue},
        view::ViewDepthTexture,
    },
};

use super::{
    clear::ClearPipelines,
    compare::{CompareGroups, ComparePipelines},
    key::{CompositeKey, Kept, LayerKey},
};
use crate::{
    gpu::GpuField,
    render::{
        edges::{EdgeTextures, EdgesPass},
        solid::{SolidPipelines, SolidTextures},
        upsample::UpsamplePipeline,
        view::{PropUniform, ViewProps, ViewTextures},
        volume::VolumePipelines,
    },
};

/// Matches `Stale` in `view.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
pub(in crate::render) struct StaleUniform {
    layer: u32,
    composite: u32,
}

/// What a view keeps.
#[derive(Component, Default)]
pub(in crate::render) struct KeptView {
    pub layer: Kept<LayerKey>,
    pub composite: Kept<CompositeKey>,
    pub(super) stale: Option<UniformBuffer<StaleUniform>>,
    /// The depth of the scene, and its colors.
    pub(super) copies: [Option<Buffer>; 2],
    pub(super) groups: CompareGroups,
}

impl KeptView {
    /// Returns the flags that tell shaders what must be drawn.
    pub fn stale(&self) -> Option<BindingResource<'_>> {
        self.stale.as_ref()?.binding()
    }
}

/// The bytes per pixel of the copies of the scene's depth and of its colors.
const COPY_BYTES: [u64; 2] = [4, 12];

pub(super) fn prepare(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    pipelines: (Res<ComparePipelines>, Res<ClearPipelines>, Res<UpsamplePipeline>),
    mut views: Query<(
        Option<(&ExtractedCamera, &ViewDepthTexture, &Msaa)>,
        &ViewProps,
        Option<&ViewTextures>,
        (Option<&SolidTextures>, &SolidPipelines, &VolumePipelines),
        (Option<&EdgeTextures>, &EdgesPass),
        &mut KeptView,
    )>,
) {
    let (compare, clear, upsample) = pipelines;
    for (camera, props, textures, (solid, solid_pipelines, volume_pipelines), (edges, edges_pass), mut view) in
        &mut views
    {
        let (Some((camera, _, msaa)), Some(textures), false) = (camera, textures, props.rect.is_empty()) else {
            *view = default();
            continue;
        };
        let KeptView { layer, composite, stale, copies, .. } = &mut *view;

        let key = layer.key();
        key.view = props.view.get().of_layer();
        key.props.clear();
        key.props.extend(props.props.get().iter().take(props.drawn.len()).map(PropUniform::of_layer));
        key.fields.clear();
        key.fields.extend(
            props.drawn.iter().map(|prop| (prop.on_gpu(&fields).map(|level| level.bind_group.id()), prop.overlap)),
        );
        (key.degree, key.samples) = (props.degree, msaa.samples());
        key.textures.clear();
        let layers = [Some(&textures.layer), textures.coarse.as_ref()];
        let solid_views = solid.into_iter().flat_map(SolidTextures::views);
        let views = layers.into_iter().flatten().flat_map(|layer| layer.views()).chain(solid_views);
        let views = views.chain(edges.into_iter().flat_map(EdgeTextures::views));
        key.textures.extend(views.map(|view| view.id()));
        let pixels = u64::from(props.view.get().size.x) * u64::from(props.view.get().size.y);
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let is_complete = pixels * COPY_BYTES[1] <= most
            && compare.are_ready(&cache)
            && clear.are_ready(&cache)
            && volume_pipelines.are_ready(&cache)
            && solid_pipelines.are_ready(&cache)
            && edges_pass.are_ready(&cache)
            && (textures.coarse.is_none() || upsample.is_ready(&cache, msaa, textures.layer.motion.is_some()));
        layer.decide(is_complete, true);

        let key = composite.key();
        key.view = *props.view.get();
        key.props.clear();
        key.props.extend(props.props.get().iter().map(PropUniform::of_composite));
        (key.space, key.stage) = (camera.compositing_space, props.stage);
        key.textures.clear();
        key.textures.extend([&textures.even, &textures.odd].map(|view| view.id()));
        composite.decide(is_complete, layer.reads_scene());

        let flags = StaleUniform {
            layer: u32::from(layer.is_drawn()),
            composite: u32::from(layer.is_drawn() || composite.is_drawn()),
        };
        let stale = stale.get_or_insert_with(|| {
            let mut buffer = UniformBuffer::default();
            buffer.set_label(Some("plenoctree_stale"));
            buffer.add_usages(BufferUsages::STORAGE);
            buffer
        });
        stale.set(flags);
        stale.write_buffer(&device, &queue);
        let reads = [layer.reads_scene(), composite.reads_scene()];
        for ((copy, reads), bytes) in copies.iter_mut().zip(reads).zip(COPY_BYTES) {
            let size = pixels * bytes;
            copy.take_if(|copy| copy.size() != size);
            if reads && copy.is_none() {
                let (label, usage) = (Some("plenoctree_scene_copy"), BufferUsages::STORAGE);
                *copy = Some(device.create_buffer(&BufferDescriptor { label, size, usage, mapped_at_creation: false }));
            }
        }
    }
}
