//! Bind groups that are kept while they bind the same resources.

use std::num::NonZero;

use bevy::render::{
    render_resource::{
        BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindingResource, PipelineCache, TextureView,
        TextureViewId,
    },
    renderer::RenderDevice,
    view::ViewTarget,
};

/// A bind group that is recreated only when one of its resources is replaced.
#[derive(Default)]
pub(super) struct KeptBindGroup {
    bound: Vec<Bound>,
    group: Option<BindGroup>,
}

#[derive(PartialEq)]
enum Bound {
    Buffer(wgpu::Buffer, u64, Option<NonZero<u64>>),
    Texture(wgpu::TextureView),
}

impl Bound {
    /// Returns `None` for resources that the plugin's passes do not bind. They never count as unchanged.
    fn new(resource: &BindingResource) -> Option<Self> {
        match resource {
            BindingResource::Buffer(binding) => {
                Some(Self::Buffer(binding.buffer.clone(), binding.offset, binding.size))
            }
            BindingResource::TextureView(view) => Some(Self::Texture((*view).clone())),
            _ => None,
        }
    }
}

impl KeptBindGroup {
    /// Recreates the group, unless it already binds `entries`.
    pub fn update(
        &mut self,
        device: &RenderDevice,
        cache: &PipelineCache,
        label: &'static str,
        layout: &BindGroupLayoutDescriptor,
        entries: &[BindGroupEntry],
    ) {
        let is_kept = self.group.is_some()
            && self.bound.len() == entries.len()
            && entries
                .iter()
                .zip(&self.bound)
                .all(|(entry, bound)| Bound::new(&entry.resource).as_ref() == Some(bound));
        if !is_kept {
            self.bound.clear();
            self.bound.extend(entries.iter().filter_map(|entry| Bound::new(&entry.resource)));
            self.group = Some(device.create_bind_group(label, &cache.get_bind_group_layout(layout), entries));
        }
    }

    /// Returns the group, if it has been created.
    pub fn get(&self) -> Option<&BindGroup> {
        self.group.as_ref()
    }
}

/// Bind groups for each of the two main textures of a view's target.
///
/// Post-processing swaps the textures, so which of them has the scene is known only when a pass runs.
#[derive(Default)]
pub(super) struct PerMainTexture<T>([(Option<TextureViewId>, T); 2]);

impl<T> PerMainTexture<T> {
    /// Calls `update` with the bind groups of each texture, and with the texture.
    pub fn update(&mut self, target: &ViewTarget, update: impl Fn(&mut T, &TextureView)) {
        let mut scenes = [target.main_texture_view(), target.main_texture_other_view()];
        // In a fixed order, groups are kept even if the textures swap from frame to frame.
        scenes.sort_by_key(|scene| scene.id());
        for ((id, groups), scene) in self.0.iter_mut().zip(scenes) {
            *id = Some(scene.id());
            update(groups, scene);
        }
    }

    /// Returns the bind groups of the texture that has the scene now, if they have been updated.
    pub fn get(&self, target: &ViewTarget) -> Option<&T> {
        let scene = target.main_texture_view().id();
        self.0.iter().find(|(id, _)| *id == Some(scene)).map(|(_, groups)| groups)
    }
}
