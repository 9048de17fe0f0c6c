//! The machinery of frames: what a pass is, and how passes are executed.

mod cache;
mod pass;
mod pipelines;
mod run;
mod slot;
mod textures;

pub(super) use cache::Comparison;
#[cfg(feature = "shadows")]
pub(super) use pass::Access;
pub(super) use pass::{
    BOX, Blend, CachedResult, Clear, Draw, FirstGroup, Fragment, Pass, Place, Program, VERTICES_OF_BATCH,
};
pub(super) use pipelines::Pipelines;
pub(crate) use run::PropView;
pub(super) use run::run;
pub(super) use slot::{RaySet, Slot};
#[cfg(feature = "shadows")]
pub(super) use {
    slot::TILE_FORMAT,
    textures::{bind, create_texture},
};
