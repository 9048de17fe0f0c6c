//! What a pass is: a row of data, which [`run`](super::run) executes.

use bevy::{
    prelude::*,
    render::render_resource::{BindGroup, BlendState, CachedRenderPipelineId, CompareFunction},
    shader::{Shader, ShaderDefVal},
};

use super::slot::{RaySet, Slot};
use crate::{
    gpu::TreeShape,
    render::plan::{Feature, Plan, PlannedProp},
};

pub(in crate::render) struct Pass {
    /// The label of the pass and of its pipelines, and the name of its span in Bevy's render diagnostics. Neighboring
    /// passes of the same name share a span.
    pub name: &'static str,
    pub place: Place,
    pub feature: Feature,
    /// The result that it contributes to, and that may be cached. Other passes run in every frame.
    pub result: Option<CachedResult>,
    pub group: FirstGroup,
    /// What it reads: one bind group after another, from group 1, or from group 2 if it marches through fields.
    pub reads: Vec<Vec<Slot>>,
    /// What its shaders store to: the bind group after these.
    pub stores: Vec<Slot>,
    pub writes: Vec<Slot>,
    pub depth: Option<Slot>,
    /// What its attachments hold when it begins. If it is `None`, they keep what they hold.
    pub clear: Option<Clear>,
    /// Whether it draws every pixel. GPUs that draw tile by tile need not load what its attachments hold.
    pub covers_all: bool,
    pub samples: u32,
    pub programs: Vec<Program>,
    /// The pipelines of these.
    pub pipelines: Vec<CachedRenderPipelineId>,
    /// The one that clears what it writes if that may be cached.
    pub clearing: Option<CachedRenderPipelineId>,
    pub draws: Vec<Draw>,
}

impl Pass {
    /// Returns a pass that draws a triangle with each of its programs, over the drawn part of the view.
    pub fn fullscreen(name: &'static str, place: Place, result: Option<CachedResult>, programs: Vec<Program>) -> Self {
        Self {
            name,
            place,
            feature: Feature::Base,
            result,
            group: FirstGroup::View,
            reads: vec![],
            stores: vec![],
            writes: vec![],
            depth: None,
            clear: None,
            covers_all: false,
            samples: 1,
            draws: (0..programs.len()).map(Draw::triangle).collect(),
            programs,
            pipelines: vec![],
            clearing: None,
        }
    }

    /// Returns everything that it reads or writes.
    pub fn slots(&self) -> impl Iterator<Item = Slot> {
        self.reads.iter().flatten().chain(&self.stores).chain(&self.writes).chain(&self.depth).copied()
    }

    /// Returns the slots of each bind group from group 1, or from group 2 if it marches through fields.
    pub fn bound(&self) -> impl Iterator<Item = (Access, &[Slot])> {
        let stores = (!self.stores.is_empty()).then_some((Access::Store, &self.stores[..]));
        self.reads.iter().map(|slots| (Access::Read, &slots[..])).chain(stores)
    }

    /// Returns whether it writes its depth texture, if only by clearing it: perhaps there is nothing to draw.
    pub fn writes_depth(&self) -> bool {
        let writes = self.programs.is_empty() || self.programs.iter().any(|program| program.depth_test.writes);
        self.depth.is_some() && writes
    }

    /// Returns the pixels that are drawn of its attachments: of textures of the target's size the drawn part of the
    /// view, and all of others. Batches are in squares of their own.
    pub fn area(&self, plan: &Plan) -> URect {
        if let FirstGroup::Batches(..) = self.group {
            return URect { min: UVec2::ZERO, max: RaySet::Batches.size(plan.rect.size) };
        }
        match self.writes.iter().chain(&self.depth).next() {
            Some(slot) if !slot.is_of_target() => URect { min: UVec2::ZERO, max: slot.rays().size(plan.rect.size) },
            _ => URect { min: plan.corner(), max: plan.corner() + plan.rect.size },
        }
    }

    /// Returns whether it may leave out props whose pipelines are not ready, and draw the others.
    pub fn may_leave_out_props(&self) -> bool {
        self.feature == Feature::Base && self.programs.iter().any(|program| program.tree.is_some())
    }
}

/// What a pass does with the slots of a bind group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render) enum Access {
    Read,
    Store,
}

/// Where in the frame a pass runs: one place after another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(in crate::render) enum Place {
    /// Between the opaque main pass and objects that transmit light.
    Layer,
    /// Before transparent objects are drawn, in views that show props at the display.
    Hide,
    /// After that.
    Restore,
    /// Where the camera's `PropPlacement` says: labels and custom stages.
    Posterize,
    /// After that.
    Present,
    /// Once transparent objects have been drawn over props.
    Objects,
}

/// A result of passes that is cached until something changes that they read. Each is made from those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum CachedResult {
    /// The props alone, and their edges.
    Layer,
    /// The props over the scene, before and after the filter.
    Composite,
    /// What is shown.
    Labels,
}

impl CachedResult {
    pub const ALL: [Self; 3] = [Self::Layer, Self::Composite, Self::Labels];
}

/// Bind group 0 of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum FirstGroup {
    /// What `view.wgsl` declares.
    View,
    /// The same, and the depth of the scene, with so many samples per pixel.
    SceneDepth(u32),
    /// The same, and what says which elements are in each batch.
    Batches(u32, Slot),
    /// Bevy's lights and fog.
    Lights,
    /// A shadow map, and its props.
    Map,
}

impl FirstGroup {
    /// Returns the one with the depth of the scene, if a pass reads that.
    pub fn with_depth_if(reads: bool, samples: u32) -> Self {
        if reads { Self::SceneDepth(samples) } else { Self::View }
    }

    /// Returns the number of samples per pixel of the scene's depth, if it has that.
    pub fn samples(self) -> Option<u32> {
        match self {
            Self::SceneDepth(samples) | Self::Batches(samples, _) => Some(samples),
            Self::View | Self::Lights | Self::Map => None,
        }
    }
}

/// What the attachments of a pass hold when it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum Clear {
    Zero,
    /// White, with an alpha of 0.
    White,
    /// Black, with an alpha of -1.
    NegativeAlpha,
}

/// A pipeline of a pass, besides what the pass determines.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(in crate::render) struct Program {
    pub fragment: Fragment,
    pub vertex: &'static str,
    pub definitions: Vec<ShaderDefVal>,
    /// The shape of the field through which it marches, in bind group 1.
    pub tree: Option<TreeShape>,
    /// Whether it binds what the pass reads and stores to.
    pub reads: bool,
    /// How it writes to each color attachment. Missing ones replace it.
    pub blends: Vec<Blend>,
    pub depth_test: DepthTest,
}

/// The name of the vertex shader that draws boxes of props.
pub(in crate::render) const BOX: &str = "box";

/// A fragment shader.
#[derive(Clone, PartialEq, Eq, Hash)]
pub(in crate::render) enum Fragment {
    Named(&'static str),
    Custom(Handle<Shader>),
}

impl Program {
    /// Returns a program that draws a triangle.
    pub fn new(fragment: &'static str) -> Self {
        Self {
            fragment: Fragment::Named(fragment),
            vertex: "fullscreen",
            definitions: vec![],
            tree: None,
            reads: true,
            blends: vec![],
            depth_test: DepthTest { compare: CompareFunction::Always, writes: false },
        }
    }

    pub fn define(mut self, name: &str) -> Self {
        self.definitions.push(name.into());
        self
    }

    pub fn define_if(self, holds: bool, name: &str) -> Self {
        if holds { self.define(name) } else { self }
    }

    pub fn define_number(mut self, name: &str, value: Option<u32>) -> Self {
        self.definitions.extend(value.map(|value| ShaderDefVal::UInt(name.into(), value)));
        self
    }

    pub fn define_all(mut self, definitions: impl IntoIterator<Item = ShaderDefVal>) -> Self {
        self.definitions.extend(definitions);
        self
    }

    pub fn depth_test(self, compare: CompareFunction, writes: bool) -> Self {
        Self { depth_test: DepthTest { compare, writes }, ..self }
    }

    /// Draws only where a prop was drawn.
    pub fn where_props_are(self) -> Self {
        self.depth_test(CompareFunction::LessEqual, false)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) enum Blend {
    Replace,
    With(BlendState),
    Masked,
}

/// Depths are reversed: nearer ones are greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::render) struct DepthTest {
    pub compare: CompareFunction,
    pub writes: bool,
}

/// The vertices of each batch. See `batches.wgsl`.
pub(in crate::render) const VERTICES_OF_BATCH: u32 = 6;

/// A draw call.
pub(in crate::render) struct Draw {
    pub program: usize,
    /// The field through which it marches: bind group 1.
    pub field: Option<BindGroup>,
    pub vertices: std::ops::Range<u32>,
    pub instance: u32,
}

impl Draw {
    /// Returns the prop that it marches through.
    pub fn prop_of<'a>(&self, plan: &'a Plan) -> Option<&'a PlannedProp> {
        self.field.as_ref().and_then(|_| plan.props.get((self.instance & 0xffff) as usize))
    }

    pub fn triangle(program: usize) -> Self {
        Self { program, field: None, vertices: 0..3, instance: 0 }
    }

    /// Draws this many batches along each axis, if there are any.
    pub fn of_batches(self, batches: UVec2) -> Option<Self> {
        let vertices = 0..VERTICES_OF_BATCH * batches.element_product();
        (!vertices.is_empty()).then_some(Self { vertices, ..self })
    }
}
