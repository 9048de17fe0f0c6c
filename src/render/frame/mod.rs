//! The machinery of frames: what a pass is, and how passes are executed.

mod bind_groups;
mod buffers;
mod cache;
mod pass;
mod pipelines;
mod run;
mod slot;
mod textures;
mod view;

#[cfg(feature = "shadows")]
pub(super) use bind_groups::BindGroups;
pub(super) use buffers::PaletteBuffer;
pub(super) use cache::Comparison;
#[cfg(feature = "shadows")]
pub(super) use pass::Access;
pub(super) use pass::{Blend, CachedResult, Clear, Draw, FirstGroup, Fragment, Pass, Place, Program};
pub(super) use pipelines::Pipelines;
pub(super) use run::run;
pub(super) use slot::{RaySet, Slot};
pub(crate) use view::PropView;
#[cfg(feature = "shadows")]
pub(super) use {slot::TILE_FORMAT, textures::create_texture};
