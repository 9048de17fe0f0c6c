//! Bind groups that are kept as long as they bind the same things.

use std::num::NonZero;

use bevy::render::{
    render_resource::{BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindingResource, PipelineCache},
    renderer::RenderDevice,
};

/// A bind group that is created anew only when something that it binds is replaced.
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
    /// `None` for what no pass of ours binds, and what is therefore never taken for the same.
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
    /// Makes sure that the group binds `entries`.
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

    /// The group, if there is one.
    pub fn get(&self) -> Option<&BindGroup> {
        self.group.as_ref()
    }
}
