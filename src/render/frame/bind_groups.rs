//! Bind groups that are cached while they bind the same resources.

use std::num::NonZero;

use bevy::{
    platform::collections::HashMap,
    render::{
        render_resource::{BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindingResource, PipelineCache},
        renderer::RenderDevice,
    },
};

/// The bind groups of a view, by what they bind.
#[derive(Default)]
pub(in crate::render) struct BindGroups {
    groups: HashMap<Key, (BindGroup, u32)>,
}

type Key = (BindGroupLayoutDescriptor, Vec<Bound>);

#[derive(PartialEq, Eq, Hash)]
enum Bound {
    Buffer(wgpu::Buffer, u64, Option<NonZero<u64>>),
    Texture(wgpu::TextureView),
}

/// For how many frames groups are cached that no pass uses. Post-processing may use another of the target's two
/// textures in every second frame.
const CACHED_FRAMES: u32 = 3;

impl BindGroups {
    /// Begins a frame: drops the groups that are not used anymore.
    pub fn begin(&mut self) {
        self.groups.retain(|_, (_, idle)| {
            *idle += 1;
            *idle <= CACHED_FRAMES
        });
    }

    /// Returns the group of `resources`, in the order of the layout's entries.
    pub fn get(
        &mut self,
        device: &RenderDevice,
        cache: &PipelineCache,
        layout: &BindGroupLayoutDescriptor,
        resources: &[BindingResource],
    ) -> BindGroup {
        let bound = resources.iter().filter_map(|resource| match resource {
            BindingResource::Buffer(binding) => {
                Some(Bound::Buffer(binding.buffer.clone(), binding.offset, binding.size))
            }
            BindingResource::TextureView(view) => Some(Bound::Texture((*view).clone())),
            // The plugin's passes bind nothing else.
            _ => None,
        });
        let key = (layout.clone(), bound.collect());
        let (group, idle) = self.groups.entry(key).or_insert_with_key(|(layout, _)| {
            let entries: Vec<_> = layout
                .entries
                .iter()
                .zip(resources)
                .map(|(entry, resource)| BindGroupEntry { binding: entry.binding, resource: resource.clone() })
                .collect();
            (device.create_bind_group(&*layout.label, &cache.get_bind_group_layout(layout), &entries), 0)
        });
        *idle = 0;
        group.clone()
    }
}
