//! The pipelines of passes, and whether they are ready.

use std::time::Duration;

use bevy::{
    platform::{
        collections::{HashMap, HashSet},
        time::Instant,
    },
    prelude::*,
    render::render_resource::{binding_types::*, *},
    shader::{Shader, ShaderCacheError, ShaderDefVal},
};

use super::{
    cache::Comparison,
    pass::{Access, BOX, Blend, CachedResult, Clear, FirstGroup, Fragment, Pass, Program},
    slot::{DEPTH_FORMAT, Slot},
};
use crate::{
    gpu::{
        Shaders, TreeShape, field_layout,
        pipelines::{self, STAGE},
    },
    render::uniforms::{FilterUniform, LabelsUniform, PropUniform, ScreenUniform, ViewUniform},
};

/// The pipelines of all passes, created when a view first needs them.
#[derive(Resource, Default)]
pub(in crate::render) struct Pipelines {
    shaders: Shaders,
    ids: HashMap<Key, CachedRenderPipelineId>,
    /// Since when custom stages have lacked something that they import, until that is logged.
    importing: HashMap<CachedRenderPipelineId, Option<Instant>>,
    /// The shapes of fields whose pipelines are not ready, among those that were asked for in this frame.
    pub waiting: HashSet<TreeShape>,
    /// The layout of bind group 0 for passes that read Bevy's lights.
    pub lights: Option<BindGroupLayoutDescriptor>,
    /// Those that compare the scene with what it was, once a view has come to rest.
    pub comparison: Option<Comparison>,
    /// Those that count as not ready, for tests: apps without a window compile all pipelines at once.
    #[cfg(test)]
    pub held_back: HashSet<CachedRenderPipelineId>,
}

/// Everything that a pipeline is compiled for.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    name: &'static str,
    program: Program,
    group: FirstGroup,
    /// The layouts of what it reads and stores to.
    bound: Vec<BindGroupLayoutDescriptor>,
    /// Vertex shaders draw nothing while it is cached.
    cached: Option<CachedResult>,
    targets: Vec<TextureFormat>,
    depth: Option<TextureFormat>,
    samples: u32,
}

/// The time after which an import of a custom stage counts as missing, and not as still being loaded.
const IMPORTING: Duration = Duration::from_secs(2);

/// Returns the name of a custom stage in messages. Its pipelines have it as their label, so that errors name its file.
fn stage_name(shader: &Handle<Shader>) -> String {
    match shader.path() {
        Some(path) => format!("{STAGE} {path}"),
        None => format!("{STAGE} {:?}", shader.id()),
    }
}

impl Pipelines {
    pub fn new(shaders: &Shaders, lights: Option<BindGroupLayoutDescriptor>) -> Self {
        Self { shaders: shaders.clone(), lights, ..default() }
    }

    /// Returns the pipelines that were requested.
    #[cfg(all(test, feature = "headless"))]
    pub fn requested(&self) -> impl Iterator<Item = CachedRenderPipelineId> {
        self.ids.values().copied()
    }

    /// Returns the pipeline of a program of a pass, if it is ready. Otherwise, it is compiled in the meantime.
    pub fn get(
        &mut self,
        cache: &PipelineCache,
        pass: &Pass,
        program: &Program,
        target: TextureFormat,
    ) -> Option<CachedRenderPipelineId> {
        let id = self.id(cache, pass, program, target);
        match cache.get_render_pipeline_state(id) {
            #[cfg(test)]
            _ if self.held_back.contains(&id) => self.waiting.extend(program.tree),
            CachedPipelineState::Ok(_) => return Some(id),
            // Fields do not wait for what never comes.
            CachedPipelineState::Err(error) if !pipelines::is_loading(error) => {}
            _ => self.waiting.extend(program.tree),
        }
        None
    }

    /// Returns whether this pipeline could not be created, or imports what may never come.
    pub fn fails(&mut self, cache: &PipelineCache, pass: &Pass, program: &Program, target: TextureFormat) -> bool {
        let id = self.id(cache, pass, program, target);
        let CachedPipelineState::Err(error) = cache.get_render_pipeline_state(id) else {
            return false;
        };
        if let (ShaderCacheError::ShaderImportNotYetAvailable, Fragment::Custom(shader)) = (error, &program.fragment) {
            let since = self.importing.entry(id).or_insert_with(|| Some(Instant::now()));
            // Bevy says nothing of this.
            if since.is_some_and(|since| since.elapsed() > IMPORTING) {
                *since = None;
                error!("{} is left out: it imports something that no shader defines", stage_name(shader));
            }
        }
        !matches!(error, ShaderCacheError::ShaderNotLoaded(_))
    }

    /// Returns this pipeline, whether it is ready or not.
    pub fn id(
        &mut self,
        cache: &PipelineCache,
        pass: &Pass,
        program: &Program,
        target: TextureFormat,
    ) -> CachedRenderPipelineId {
        let bound = pass.bound().filter(|_| program.reads);
        let key = Key {
            name: pass.name,
            program: program.clone(),
            group: pass.group,
            bound: bound.map(|(access, slots)| self.bound_layout(pass.name, access, slots)).collect(),
            cached: pass.result,
            targets: pass.writes.iter().map(|slot| slot.format().unwrap_or(target)).collect(),
            depth: pass.depth.and_then(Slot::format),
            samples: pass.samples,
        };
        if let Some(id) = self.ids.get(&key) {
            return *id;
        }
        let id = cache.queue_render_pipeline(self.descriptor(&key));
        self.ids.insert(key, id);
        id
    }

    /// Returns the pipeline that clears the attachments of a pass whose result may be cached, if it is ready.
    pub fn clear(
        &mut self,
        cache: &PipelineCache,
        pass: &Pass,
        target: TextureFormat,
    ) -> Option<CachedRenderPipelineId> {
        let clear = pass.clear?;
        let mut program = Program { reads: false, ..Program::new("clear") };
        for (index, slot) in pass.writes.iter().enumerate() {
            let kind = match slot.format().and_then(|format| format.sample_type(None, None)) {
                Some(TextureSampleType::Uint) => "UINT",
                _ => "FLOAT",
            };
            program = program.define(&format!("{kind}_{index}"));
        }
        if clear == Clear::NegativeAlpha {
            program = program.define("NEGATIVE_ALPHA");
        }
        if pass.writes_depth() {
            program = program.define("DEPTH").depth_test(wgpu::CompareFunction::Always, true);
        }
        self.get(cache, pass, &program, target)
    }

    /// Returns the layout of bind group 0.
    pub fn first_layout(&self, group: FirstGroup) -> BindGroupLayoutDescriptor {
        if let (FirstGroup::Lights, Some(lights)) = (group, &self.lights) {
            return lights.clone();
        }
        let (both, fragment) = (ShaderStages::VERTEX_FRAGMENT, ShaderStages::FRAGMENT);
        let mut entries = vec![
            uniform_buffer::<ViewUniform>(false).build(0, both),
            storage_buffer_read_only::<Vec<PropUniform>>(false).build(1, both),
            uniform_buffer::<ScreenUniform>(false).build(2, both),
            storage_buffer_read_only::<Vec<FilterUniform>>(false).build(3, fragment),
            storage_buffer_read_only::<Vec<LabelsUniform>>(false).build(4, fragment),
            storage_buffer_read_only::<Vec<Vec4>>(false).build(5, fragment),
            uniform_buffer::<u32>(false).build(6, both),
        ];
        if group == FirstGroup::Map {
            entries.truncate(2);
        }
        match group.samples() {
            Some(1) => entries.push(texture_depth_2d().build(7, fragment)),
            Some(_) => entries.push(texture_depth_2d_multisampled().build(7, fragment)),
            None => {}
        }
        if let FirstGroup::Batches(..) = group {
            entries.push(storage_buffer_read_only_sized(false, None).build(8, both));
        }
        BindGroupLayoutDescriptor::new("plenoctree_view", &entries)
    }

    /// Returns the layout of a bind group of what a pass reads or stores to.
    pub fn bound_layout(&self, name: &'static str, access: Access, slots: &[Slot]) -> BindGroupLayoutDescriptor {
        let entry = |slot: &Slot| match slot {
            Slot::View | Slot::Screen => uniform_buffer_sized(false, None),
            _ if slot.is_buffer() && access == Access::Store => storage_buffer_sized(false, None),
            _ if slot.is_buffer() => storage_buffer_read_only_sized(false, None),
            _ => match slot.format() {
                Some(format) if access == Access::Store => texture_storage_2d(format, StorageTextureAccess::WriteOnly),
                Some(DEPTH_FORMAT) => texture_depth_2d(),
                Some(format) if format.sample_type(None, None) == Some(TextureSampleType::Uint) => {
                    texture_2d(TextureSampleType::Uint)
                }
                _ => texture_2d(TextureSampleType::Float { filterable: false }),
            },
        };
        let bindings = (0..).zip(slots);
        let entries: Vec<_> =
            bindings.map(|(binding, slot)| entry(slot).build(binding, ShaderStages::FRAGMENT)).collect();
        BindGroupLayoutDescriptor::new(name, &entries)
    }

    fn descriptor(&self, key: &Key) -> RenderPipelineDescriptor {
        let program = &key.program;
        let mut definitions = program.definitions.clone();
        let mut layout = vec![self.first_layout(key.group)];
        if let Some(tree) = program.tree {
            layout.push(field_layout());
            definitions.extend(tree.definitions());
        }
        layout.extend(key.bound.iter().cloned());
        if key.group.samples().is_some_and(|samples| samples > 1) {
            definitions.push("MULTISAMPLED".into());
        }
        if let FirstGroup::Batches(_, Slot::BatchGaps) = key.group {
            definitions.push("BATCHED".into());
        }
        let mut vertex_definitions = definitions.clone();
        vertex_definitions.extend(key.cached.map(|result| ShaderDefVal::UInt("CACHED".into(), result as u32)));
        vertex_definitions.extend((key.group == FirstGroup::Lights).then(|| "LIGHTS".into()));
        let blends = program.blends.iter().chain(std::iter::repeat(&Blend::Replace));
        let targets = key.targets.iter().zip(blends).map(|(format, blend)| {
            let (blend, write_mask) = match blend {
                Blend::Replace => (None, ColorWrites::ALL),
                Blend::With(blend) => (Some(*blend), ColorWrites::ALL),
                Blend::Masked => (None, ColorWrites::empty()),
            };
            Some(ColorTargetState { format: *format, blend, write_mask })
        });
        RenderPipelineDescriptor {
            label: Some(match &program.fragment {
                Fragment::Named(_) => key.name.into(),
                Fragment::Custom(shader) => stage_name(shader).into(),
            }),
            layout,
            vertex: VertexState {
                shader: self.shaders.get(program.vertex),
                shader_defs: vertex_definitions,
                entry_point: Some("vertex".into()),
                ..default()
            },
            // Each pixel of a box is drawn once, even from inside it.
            primitive: PrimitiveState { cull_mode: (program.vertex == BOX).then_some(Face::Front), ..default() },
            fragment: Some(FragmentState {
                shader: match &program.fragment {
                    Fragment::Named(name) => self.shaders.get(name),
                    Fragment::Custom(shader) => shader.clone(),
                },
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: targets.collect(),
            }),
            depth_stencil: key.depth.map(|format| DepthStencilState {
                format,
                depth_write_enabled: Some(program.depth_test.writes),
                depth_compare: Some(program.depth_test.compare),
                stencil: default(),
                bias: default(),
            }),
            multisample: wgpu::MultisampleState { count: key.samples, ..default() },
            ..default()
        }
    }
}
