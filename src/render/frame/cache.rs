//! What views keep from frame to frame, so that nothing is drawn twice.
//!
//! A [`CachedResult`] of a frame is stale if anything changes that its passes read: a uniform, a texture, a buffer or a
//! field, or the result that it is made from. Most of this follows from the passes themselves; `key` lists which
//! uniforms of bind group 0 each result reads. Bevy redraws the scene and its shadow maps in every frame, so wherever
//! nothing else has changed, a compute shader compares the scene, and the light on props, with what they were, and
//! notes the first result that must be drawn if they differ. The vertex shaders of all passes of earlier results draw
//! nothing.
//!
//! Views in which something changes in every frame, because the camera moves, compare and remember nothing.

use std::hash::{BuildHasher, Hash, Hasher};

use bevy::{
    platform::hash::FixedHasher,
    prelude::*,
    render::{
        render_resource::{binding_types::*, *},
        renderer::{RenderContext, RenderDevice},
    },
    shader::ShaderDefVal,
};

use super::{
    pass::{CachedResult, FirstGroup, Pass},
    slot::Slot,
    textures::{Textures, bind},
};
use crate::{
    gpu::Shaders,
    render::{
        plan::Plan,
        uniforms::{ViewBuffers, ViewUniform},
    },
};

/// What a view keeps.
#[derive(Default)]
pub(in crate::render) struct Cache {
    /// What determines the results of this frame.
    keys: [u64; 3],
    /// What determined those of the last frame that was drawn, if they still exist.
    drawn: [Option<u64>; 3],
    /// How many results are as they were, as far as is known before the scene is drawn. Those after them have changed.
    unchanged: usize,
    /// How many of these are only drawn if the scene has changed. For the others, what it was is not known.
    first_drawn: usize,
    /// What the scene was: for [`ROWS`] pixels of a column, a word for their depths, and then, if anything is
    /// posterized, one for their colors, and one for the light on props, if there is any.
    scene: Option<Buffer>,
    /// Whether the words that each result depends on are those of the frame that was drawn.
    knows: [bool; 3],
}

impl Cache {
    /// Decides what is drawn in this frame. `is_complete` says whether no pipeline is missing. Returns whether any result
    /// may be kept, so that the scene is compared.
    pub fn decide(
        &mut self,
        device: &RenderDevice,
        passes: &[Pass],
        textures: &mut Textures,
        buffers: &ViewBuffers,
        is_complete: bool,
        plan: &Plan,
    ) -> bool {
        // Where nothing is posterized, labels are drawn in every frame, whatever the light is.
        let has_light = plan.posterizes && plan.is_lit;
        self.knows[CachedResult::Labels as usize] |= !has_light;
        self.keys = CachedResult::ALL.map(|result| key(result, passes, textures, buffers, plan));
        let same = self.keys.iter().zip(&self.drawn).take_while(|(key, drawn)| **drawn == Some(**key)).count();
        // What is only blended over the scene is drawn faster than the scene is compared.
        let most = if plan.posterizes { CachedResult::ALL.len() } else { CachedResult::Labels as usize };
        self.unchanged = if is_complete { same.min(most) } else { 0 };
        // Whatever is drawn differently now, even if incompletely, replaces what was cached.
        self.drawn = default();
        let words = 1 + u64::from(plan.posterizes) + u64::from(has_light);
        let across = words_across(plan.rect.size);
        let size = 4 * words * u64::from(across.x) * u64::from(across.y);
        if self.unchanged == 0 {
            self.scene = None;
        } else if self.scene.as_ref().is_none_or(|scene| scene.size() != size) {
            self.scene = textures.allocator.buffer(device, "plenoctree_scene", size, BufferUsages::STORAGE);
            self.knows = default();
        }
        self.first_drawn = self.knows.iter().take(self.unchanged).take_while(|knows| **knows).count();
        self.unchanged > 0
    }

    /// Returns the index of the first result that must be drawn even if the scene has not changed, or the number of
    /// results if none must be. Those after it are made from it.
    pub fn first_drawn(&self) -> u32 {
        self.first_drawn as u32
    }

    /// Returns the bytes of GPU memory that remember the scene.
    #[cfg(all(test, feature = "headless"))]
    pub fn bytes(&self) -> u64 {
        self.scene.as_ref().map_or(0, |scene| scene.size())
    }

    /// Returns whether a result is drawn even if the scene has not changed.
    pub fn is_drawn(&self, result: CachedResult) -> bool {
        self.first_drawn <= result as usize
    }

    /// Compares the scene, or the light on props, with what it was, before the passes of a result. Notes that these draw
    /// it, unless it is as it was.
    pub fn compare(
        &mut self,
        result: CachedResult,
        scene: Option<&TextureView>,
        plan: &Plan,
        buffers: &ViewBuffers,
        comparison: Option<&Comparison>,
        cache: &PipelineCache,
        ctx: &mut RenderContext,
    ) {
        let index = result as usize;
        self.drawn[index] = Some(self.keys[index]);
        let (Some(scene), Some(comparison)) = (scene, comparison) else {
            return;
        };
        let words = self.scene.as_ref().filter(|_| index < self.unchanged);
        let (layout, id) = comparison.of(result, plan.samples);
        let pipeline = cache.get_compute_pipeline(*id);
        let (Some(view), Some(first_drawn)) = (buffers.view.binding(), buffers.first_drawn.binding()) else {
            return;
        };
        if let (Some(words), Some(pipeline)) = (words, pipeline) {
            let resources = [view, first_drawn, words.as_entire_binding(), BindingResource::TextureView(scene)];
            let group = bind(ctx.render_device(), cache, layout, &resources);
            let encoder = ctx.command_encoder();
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor { label: Some(COMPARE), ..default() });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &*group, &[]);
            let groups = (words_across(plan.rect.size) + 7) / 8;
            pass.dispatch_workgroups(groups.x, groups.y, 1);
            self.knows[index] = true;
        } else {
            self.knows[index] = false;
        }
    }
}

/// Returns a number that is different whenever anything changes that the passes of a result read, besides the scene.
fn key(result: CachedResult, passes: &[Pass], textures: &Textures, buffers: &ViewBuffers, plan: &Plan) -> u64 {
    let mut hasher = FixedHasher.build_hasher();
    // The first result to draw follows from all keys, and no cached pass reads fog.
    let ViewBuffers { view, props, screen, filters, labelings, lit, shades, first_drawn: _, no_fog: _ } = buffers;
    let labels = || (labelings.hash, plan.values.palettes);
    match result {
        CachedResult::Layer => (view.hash, props.hash, plan.recolors.then(labels)).hash(&mut hasher),
        CachedResult::Composite => (view.hash, screen.hash, filters.hash).hash(&mut hasher),
        CachedResult::Labels => (view.hash, props.hash, screen.hash, labels()).hash(&mut hasher),
    }
    for pass in passes.iter().filter(|pass| pass.result == Some(result)) {
        (pass.name, pass.group, &pass.reads, &pass.stores, &pass.writes, pass.depth, pass.samples, &pass.programs)
            .hash(&mut hasher);
        for draw in &pass.draws {
            (draw.program, &draw.vertices, draw.instance).hash(&mut hasher);
            draw.field.as_ref().map(|field| field.id()).hash(&mut hasher);
        }
        // What it draws may be listed by a pass of a later result.
        if let FirstGroup::Batches(_, list) = pass.group {
            passes.iter().filter(|pass| pass.stores.contains(&list)).for_each(|pass| pass.programs.hash(&mut hasher));
        }
        for slot in pass.slots() {
            match slot {
                Slot::View => view.hash.hash(&mut hasher),
                Slot::Screen => screen.hash.hash(&mut hasher),
                Slot::Lit => lit.hash.hash(&mut hasher),
                Slot::Shades => shades.hash.hash(&mut hasher),
                // The GPU compares the scene, and batches are only read in frames in which they are written.
                Slot::Scene | Slot::BatchGaps | Slot::BatchEdges => {}
                Slot::Coverage => textures.buffer(slot).map(|buffer| buffer.id()).hash(&mut hasher),
                _ => textures.get(slot).map(|view| view.id()).hash(&mut hasher),
            }
        }
    }
    hasher.finish()
}

/// The pixels of a column that share a word. Matches `compare.wgsl`.
const ROWS: u32 = 8;

/// Returns the numbers of words for `size` pixels, along each axis.
fn words_across(size: UVec2) -> UVec2 {
    UVec2::new(size.x, size.y.div_ceil(ROWS))
}

const COMPARE: &str = "plenoctree_compare";

/// The pipelines that compare the scene with what it was.
pub(in crate::render) struct Comparison {
    /// The depth of a single-sampled scene, that of a multisampled one, the scene's colors, and light.
    pipelines: [(BindGroupLayoutDescriptor, CachedComputePipelineId); 4],
}

impl Comparison {
    pub fn new(cache: &PipelineCache, shaders: &Shaders) -> Self {
        let pipeline = |result, scene, definition: &str| {
            let words = || storage_buffer_sized(false, None);
            let entries = (uniform_buffer::<ViewUniform>(false), words(), words(), scene);
            let entries = BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, entries);
            let layout = BindGroupLayoutDescriptor::new(COMPARE, &entries);
            let id = cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(COMPARE.into()),
                layout: vec![layout.clone()],
                shader: shaders.get("compare"),
                shader_defs: vec![definition.into(), ShaderDefVal::UInt("RESULT".into(), result as u32)],
                entry_point: Some("compare".into()),
                ..default()
            });
            (layout, id)
        };
        let colors = || texture_2d(TextureSampleType::Float { filterable: false });
        Self {
            pipelines: [
                pipeline(CachedResult::Layer, texture_depth_2d(), "DEPTH"),
                pipeline(CachedResult::Layer, texture_depth_2d_multisampled(), "MULTISAMPLED"),
                pipeline(CachedResult::Composite, colors(), "COLORS"),
                pipeline(CachedResult::Labels, colors(), "LIGHT"),
            ],
        }
    }

    fn of(&self, result: CachedResult, samples: u32) -> &(BindGroupLayoutDescriptor, CachedComputePipelineId) {
        match result {
            CachedResult::Layer => &self.pipelines[usize::from(samples > 1)],
            CachedResult::Composite => &self.pipelines[2],
            CachedResult::Labels => &self.pipelines[3],
        }
    }
}
