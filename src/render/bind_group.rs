//! Bind groups that are kept while they bind the same resources.

use std::num::NonZero;

use bevy::render::{
    render_resource::{BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindingResource, PipelineCache},
    renderer::RenderDevice,
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
