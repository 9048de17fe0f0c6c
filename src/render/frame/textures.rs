//! The owner of a view's textures and buffers. Where there is too little memory for them, a view draws no props instead
//! of ending the app.
//!
//! They are as large as what the props cover, in steps, so that props that move do not recreate them in every frame.

use bevy::{
    platform::collections::HashMap,
    prelude::*,
    render::{render_resource::*, renderer::RenderDevice},
};

use super::{
    pass::Pass,
    slot::{Slot, WORDS_OF_EDGES, WORDS_OF_GAPS},
};
use crate::{
    gpu::Allocator,
    render::plan::{BATCH, Plan, batches},
};

#[derive(Default)]
pub(in crate::render) struct Textures {
    /// With the number of frames since a pass last used each.
    textures: HashMap<Slot, (TextureView, u32)>,
    buffers: HashMap<Slot, (Buffer, u32)>,
    /// The size of textures with one texel per pixel.
    size: UVec2,
    pub allocator: Allocator,
}

/// For how many frames textures and buffers stay that no pass uses.
const IDLE_FRAMES: u32 = 2;

/// The sizes of small textures are multiples of this, in pixels, unless the viewport is smaller.
const STEP: u32 = 64;

impl Textures {
    /// Makes sure that there is everything that `passes` use, and drops the rest. Returns whether there is enough
    /// memory.
    pub fn provide(&mut self, device: &RenderDevice, passes: &[Pass], plan: &Plan) -> bool {
        self.size = size_in_steps(self.size, plan.rect.size, plan.viewport.physical_size);
        self.textures.values_mut().for_each(|(_, idle)| *idle += 1);
        self.buffers.values_mut().for_each(|(_, idle)| *idle += 1);
        let saved_depth = plan.has_objects.then_some(Slot::SceneDepth);
        let mut used = passes.iter().flat_map(Pass::slots).chain(saved_depth);
        let has_memory = used.all(|slot| self.create(device, slot, plan));
        self.textures.retain(|_, (_, idle)| *idle <= IDLE_FRAMES);
        self.buffers.retain(|_, (_, idle)| *idle <= IDLE_FRAMES);
        has_memory
    }

    /// Returns the bytes of GPU memory that they take.
    #[cfg(all(test, feature = "headless"))]
    pub fn bytes(&self) -> u64 {
        let textures = self.textures.values().map(|(view, _)| {
            let texture = view.texture();
            let bytes = texture.format().block_copy_size(None).unwrap_or(4);
            u64::from(texture.width() * texture.height() * texture.sample_count() * bytes)
        });
        textures.chain(self.buffers.values().map(|(buffer, _)| buffer.size())).sum()
    }

    pub fn clear(&mut self) {
        self.textures.clear();
        self.buffers.clear();
        self.size = UVec2::ZERO;
    }

    pub fn swap(&mut self, a: Slot, b: Slot) {
        let (of_a, of_b) = (self.textures.remove(&a), self.textures.remove(&b));
        self.textures.extend(of_a.map(|existing| (b, existing)));
        self.textures.extend(of_b.map(|existing| (a, existing)));
    }

    pub fn get(&self, slot: Slot) -> Option<&TextureView> {
        self.textures.get(&slot).map(|(view, _)| view)
    }

    pub fn buffer(&self, slot: Slot) -> Option<&Buffer> {
        self.buffers.get(&slot).map(|(buffer, _)| buffer)
    }

    /// Creates what a slot holds, unless it exists or belongs to others. Returns whether there is enough memory.
    fn create(&mut self, device: &RenderDevice, slot: Slot, plan: &Plan) -> bool {
        let batches = batches(self.size).element_product();
        match slot {
            Slot::View | Slot::Screen | Slot::Lit | Slot::Shades => true,
            Slot::Scene | Slot::Target | Slot::TargetDepth | Slot::PrepassMotion => true,
            Slot::BatchGaps => self.create_buffer(device, slot, batches * WORDS_OF_GAPS),
            Slot::BatchEdges => self.create_buffer(device, slot, plan.edge_lists() * batches * WORDS_OF_EDGES),
            Slot::Coverage => self.create_buffer(device, slot, self.size.element_product()),
            _ => self.create_texture(device, slot, plan),
        }
    }

    fn create_texture(&mut self, device: &RenderDevice, slot: Slot, plan: &Plan) -> bool {
        let (mut size, mut format, mut samples) = (slot.rays().size(self.size), slot.format(), 1);
        if slot.is_of_target() {
            size = plan.target.size;
            format = format.or(Some(plan.target.format));
            samples = if slot == Slot::Objects { 1 } else { plan.samples };
        }
        let Some(format) = format else {
            return false;
        };
        // Passes bind what they know of the former frame even if they read nothing of it.
        let is_former = matches!(slot, Slot::FormerLabels | Slot::FormerDepth);
        if is_former && !plan.reads_former() {
            size = UVec2::ONE;
        }
        // The former frame may have had another size.
        let may_differ = is_former && plan.reads_former();
        let usage = match slot {
            Slot::SceneDepth => TextureUsages::COPY_DST,
            Slot::OwnRays | Slot::OtherRays => TextureUsages::STORAGE_BINDING,
            Slot::Even if plan.has_several_props => TextureUsages::STORAGE_BINDING,
            _ => TextureUsages::empty(),
        };
        if let Some((view, idle)) = self.textures.get_mut(&slot)
            && (view.texture().format(), view.texture().sample_count()) == (format, samples)
            && (view.texture().size() == extent(size) || may_differ)
            && view.texture().usage().contains(usage)
        {
            *idle = 0;
            return true;
        }
        let create = || create_texture(device, "plenoctree_view", size, samples, format, usage);
        self.allocator.create(device, create).map(|view| self.textures.insert(slot, (view, 0))).is_some()
    }

    fn create_buffer(&mut self, device: &RenderDevice, slot: Slot, words: u32) -> bool {
        let size = 4 * u64::from(words);
        if let Some((_, idle)) = self.buffers.get_mut(&slot).filter(|(buffer, _)| buffer.size() == size) {
            *idle = 0;
            return true;
        }
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let created = self.allocator.buffer(device, "plenoctree_view", size, usage);
        created.map(|buffer| self.buffers.insert(slot, (buffer, 0))).is_some()
    }
}

/// Creates a texture that passes draw to and read, for a `usage` besides that.
pub(in crate::render) fn create_texture(
    device: &RenderDevice,
    label: &'static str,
    size: UVec2,
    samples: u32,
    format: TextureFormat,
    usage: TextureUsages,
) -> TextureView {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: extent(size),
        mip_level_count: 1,
        sample_count: samples,
        dimension: TextureDimension::D2,
        format,
        usage: usage | TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&default())
}

/// Creates the bind group of `resources`, in the order of the layout's entries.
pub(in crate::render) fn bind<'a>(
    device: &RenderDevice,
    cache: &PipelineCache,
    layout: &BindGroupLayoutDescriptor,
    resources: &[BindingResource<'a>],
) -> BindGroup {
    let numbered = layout.entries.iter().map(|entry| entry.binding).zip(resources);
    let entry =
        |(binding, resource): (u32, &BindingResource<'a>)| BindGroupEntry { binding, resource: resource.clone() };
    let entries: Vec<_> = numbered.map(entry).collect();
    device.create_bind_group(&*layout.label, &cache.get_bind_group_layout(layout), &entries)
}

fn extent(size: UVec2) -> Extent3d {
    Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 }
}

/// Returns the size of textures for `drawn` pixels: that of the `existing` ones, unless they are too small or much
/// larger.
fn size_in_steps(existing: UVec2, drawn: UVec2, viewport: UVec2) -> UVec2 {
    // Of large sizes, an eighth to a quarter, so that a prop that comes nearer does not recreate them every few frames.
    let step = UVec2::new(drawn.x.next_power_of_two(), drawn.y.next_power_of_two()) / 8;
    let step = step.max(UVec2::splat(STEP));
    // Whole squares, so that batches have a place.
    let limit = BATCH * batches(viewport.max(drawn));
    let stepped = ((drawn + step - 1) / step * step).min(limit);
    let is_enough = existing.cmpge(BATCH * batches(drawn)).all() && existing.cmple(limit).all();
    let most = 2 * (stepped + STEP).element_product();
    if is_enough && existing.element_product() <= most { existing } else { stepped }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Textures hold what is drawn, are never much larger, and stay the same while a prop of one size moves.
        #[test]
        fn sizes_change_in_steps(
            existing in prop::array::uniform2(0u32..4000),
            drawn in prop::array::uniform2(1u32..3000),
            moved in prop::array::uniform2(0u32..16),
            beyond in prop::array::uniform2(0u32..1000),
        ) {
            let (existing, drawn, beyond) = (UVec2::from(existing), UVec2::from(drawn), UVec2::from(beyond));
            let viewport = drawn + beyond;
            let size = size_in_steps(existing, drawn, viewport);
            prop_assert!(size.cmpge(BATCH * batches(drawn)).all() && size.cmplt(viewport + BATCH).all());
            prop_assert!(size.element_product() <= 2 * (drawn + drawn / 4 + 2 * STEP).element_product());
            let smaller = drawn.saturating_sub(UVec2::from(moved)).max(UVec2::ONE);
            let size = size_in_steps(UVec2::ZERO, drawn, viewport);
            prop_assert_eq!(size_in_steps(size, smaller, viewport), size);
        }
    }
}
