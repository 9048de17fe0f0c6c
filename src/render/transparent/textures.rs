//! The texture that transparent objects are drawn to.

use bevy::{
    core_pipeline::core_3d::Transparent3d,
    prelude::*,
    render::{
        camera::ExtractedCamera, render_phase::ViewSortedRenderPhases, render_resource::TextureDescriptor,
        renderer::RenderDevice, texture::ColorAttachment, view::ExtractedView,
    },
};

use crate::{
    render::{
        extract::VisibleProps,
        view::{ViewMemory, ViewProps, view_texture},
    },
    stage::PropStage,
};

/// The transparent objects of a view, over nothing. A component of views that draw both them and props at the display.
#[derive(Component)]
pub(super) struct TransparentTexture(pub ColorAttachment);

pub(super) fn prepare_textures(
    mut commands: Commands,
    device: Res<RenderDevice>,
    phases: Res<ViewSortedRenderPhases<Transparent3d>>,
    mut views: Query<(
        Entity,
        Option<(&ExtractedView, &ExtractedCamera, &Msaa)>,
        &VisibleProps,
        &ViewProps,
        &mut ViewMemory,
    )>,
) {
    for (entity, camera, visible, props, mut memory) in &mut views {
        let draws = |view: &ExtractedView| {
            let phase = phases.get(&view.retained_view_entity);
            props.stage == PropStage::Display
                && !props.drawn.is_empty()
                // A posterized view shows nothing but labels.
                && visible.everything.is_none()
                && phase.is_some_and(|phase| !phase.items.is_empty())
        };
        let target = camera.filter(|(view, ..)| draws(view)).and_then(|(view, camera, msaa)| {
            let size = camera.physical_target_size?;
            Some((view.target_format, size, msaa.samples()))
        });
        let attachment = target.and_then(|(format, size, samples)| {
            let mut texture = |sample_count| {
                let descriptor = view_texture("plenoctree_transparent", format, size);
                memory.texture(&device, TextureDescriptor { sample_count, ..descriptor })
            };
            let sampled = if samples > 1 { Some(texture(samples)?) } else { None };
            Some(ColorAttachment::new(texture(1)?, sampled, None, Some(wgpu::Color::TRANSPARENT)))
        });
        match attachment {
            Some(attachment) => commands.entity(entity).insert(TransparentTexture(attachment)),
            None => commands.entity(entity).remove::<TransparentTexture>(),
        };
    }
}
