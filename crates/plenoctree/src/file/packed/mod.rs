//! Reading and writing packed fields: `.plenoctree` files. `docs/format.md` specifies them.

mod container;
mod decode;
#[cfg(feature = "write")]
mod encode;
mod entropy;
mod histogram;
mod planes;
mod streams;

pub(super) use container::MAGIC;
pub(super) use decode::read_packed;

/// The names of the sections, in the order of the file.
const HEAD: &str = "HEAD";
const TREE: &str = "TREE";
const DENSITIES: &str = "DENS";
const LEVELS: &str = "LEVL";
const CONSTANTS: &str = "BASE";
const TABLE: &str = "BOOK";
const ROWS: &str = "ROWS";
const HISTOGRAM: &str = "HIST";

/// Size of the section `HEAD` in bytes.
const HEAD_BYTES: usize = 88;
