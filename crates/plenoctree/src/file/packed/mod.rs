//! Reading and writing packed fields: `.plenoctree` files. `docs/format.md` specifies them.

mod container;
mod decode;
#[cfg(feature = "write")]
mod encode;
mod entropy;
mod histogram;
mod quantized;
mod recent;
mod sections;
mod streams;

pub(super) use container::MAGIC;
pub(super) use decode::read_packed;
#[cfg(feature = "write")]
pub(crate) use quantized::{COLOR_RANGES, MAX_LEVELS, MAX_ROWS, Quantized};
#[cfg(feature = "write")]
pub(crate) use recent::{RECENT, Recent};
