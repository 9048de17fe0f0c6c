//! The machinery of frames: what a pass is, and how passes are executed.

mod bind_groups;
mod cache;
mod content;
mod pass;
mod pipelines;
mod run;
mod slot;
mod textures;
mod uniforms;

pub(super) use bind_groups::BindGroups;
pub(super) use cache::{Cache, Comparison};
pub(super) use pass::{
    Area, Blend, Clear, Draw, Feature, Fragment, Input, Output, Part, Pass, Place, Program, Uniforms,
};
pub(super) use pipelines::{InitPipelines, Pipelines};
#[cfg(feature = "shadows")]
pub(super) use run::Lights;
pub(super) use run::run;
pub(super) use slot::{BATCH, Buffer, Rays, Slot, Turn, batch_side, batches};
pub(super) use textures::{Sizes, Textures};
pub(super) use uniforms::{PaletteBuffer, Values, ViewBuffers};
