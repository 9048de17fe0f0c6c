//! Decides what each view draws again, as far as that is known before the scene is drawn.

use bevy::{
    prelude::*,
    render::{
        camera::ExtractedCamera,
        render_asset::RenderAssets,
        render_resource::{BufferUsages, PipelineCache, UniformBuffer},
        renderer::{RenderDevice, RenderQueue},
        view::ViewDepthTexture,
    },
};

use super::{
    clear::ClearPipelines,
    compare::{COPY_FORMATS, ComparePipelines},
    copy::SceneCopy,
    part::KeptPart,
    view::{KeptView, StaleUniform},
};
use crate::{
    gpu::GpuField,
    render::{
        blend::{BlendPass, BlendedTexture},
        composite::CompositeTextures,
        edges::{EdgeTextures, EdgesPass},
        label::ShownTexture,
        lighting::ReadLighting,
        refine::RefinePass,
        solid::{SolidPipelines, SolidTextures},
        target::hidden_samples,
        view::{PropUniform, ViewMemory, ViewProps, ViewTextures},
        volume::VolumePipelines,
    },
};

pub(super) fn prepare(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    fields: Res<RenderAssets<GpuField>>,
    pipelines: (Res<ComparePipelines>, Res<ClearPipelines>),
    mut views: Query<(
        Option<(&ExtractedCamera, &ViewDepthTexture, &Msaa)>,
        &ViewProps,
        (Option<&ViewTextures>, &RefinePass),
        (Option<&SolidTextures>, &SolidPipelines, &VolumePipelines),
        (Option<&EdgeTextures>, &EdgesPass),
        (Option<&CompositeTextures>, Option<&ShownTexture>, Option<&BlendedTexture>),
        (&BlendPass, &ReadLighting),
        (&mut KeptView, &mut ViewMemory),
    )>,
) {
    let (compare, clear) = pipelines;
    for (
        camera,
        props,
        (textures, refine),
        (solid, solid_pipelines, volume_pipelines),
        (edges, edges_pass),
        (composited, shown, blended),
        (blend_pass, lighting),
        (mut view, mut memory),
    ) in &mut views
    {
        let (Some((camera, _, msaa)), Some(textures), false) = (camera, textures, props.rect.is_empty()) else {
            *view = default();
            continue;
        };
        let KeptView { layer, composite, labels, copies, .. } = &mut *view;

        let key = layer.key();
        key.view = props.view.get().of_layer();
        key.props.clear();
        key.props.extend(props.props.get().iter().take(props.drawn.len()).map(PropUniform::of_layer));
        key.fields.clear();
        key.fields.extend(props.drawn.iter().map(|prop| {
            let field = prop.on_gpu(&fields).map(|level| level.bind_group.id());
            (field, prop.overlap, prop.lit.is_some())
        }));
        key.samples = msaa.samples();
        key.textures.clear();
        let solid_views = solid.into_iter().flat_map(SolidTextures::views);
        let views = textures.layers().chain(solid_views).chain(edges.into_iter().flat_map(EdgeTextures::views));
        key.textures.extend(views.map(|view| view.id()));
        let is_complete = compare.are_ready(&cache)
            && clear.are_ready(&cache)
            && volume_pipelines.are_ready(&cache)
            && solid_pipelines.are_ready(&cache)
            && edges_pass.are_ready(&cache)
            && blend_pass.are_ready(&cache)
            && refine.is_ready(&cache);
        layer.decide(is_complete, true);

        let key = composite.key();
        key.view = *props.view.get();
        key.props.clear();
        key.props.extend(props.props.get().iter().map(PropUniform::of_composite));
        (key.space, key.stage) = (camera.compositing_space, props.stage);
        key.textures.clear();
        let views = composited.into_iter().flat_map(|composite| [&composite.even, &composite.odd]);
        key.textures.extend(views.map(|view| view.id()));
        composite.decide(is_complete, layer.reads_scene());

        let key = labels.key();
        key.props.clear();
        key.props.extend(props.props.get().iter().map(PropUniform::of_labels));
        key.colors.clear();
        key.colors.extend(props.props.get().iter().flat_map(|prop| prop.palette(props.colors.get())));
        key.samples = hidden_samples(props, msaa);
        key.textures.clear();
        let views = shown.map(|shown| &shown.0).into_iter().chain(blended.map(|blended| &blended.0));
        key.textures.extend(views.map(|view| view.id()));
        // Custom stages write to the texture, and there is no way to tell whether shadows that fall on props have
        // changed.
        labels.decide(is_complete && !props.has_stages && !lighting.is_lit, composite.reads_scene());

        let reads = [layer.reads_scene(), composite.reads_scene()];
        let size = props.view.get().size;
        for ((copy, reads), format) in copies.iter_mut().zip(reads).zip(COPY_FORMATS) {
            copy.take_if(|copy| copy.size() != size);
            if reads && copy.is_none() {
                *copy = memory.create(&device, || SceneCopy::new(&device, size, format));
            }
        }
        if copies.iter().zip(reads).any(|(copy, reads)| reads && copy.is_none()) {
            // Nothing is drawn without memory.
            *view = default();
            continue;
        }
        let [layer, composite, labels] =
            [KeptPart::Layer, KeptPart::Composite, KeptPart::Labels].map(|part| u32::from(view.is_drawn(part)));
        let stale = view.stale.get_or_insert_with(|| {
            let mut buffer = UniformBuffer::default();
            buffer.set_label(Some("plenoctree_stale"));
            buffer.add_usages(BufferUsages::STORAGE);
            buffer
        });
        stale.set(StaleUniform { layer, composite, labels });
        stale.write_buffer(&device, &queue);
    }
}
