//! The sections of a packed field.

/// The names of the sections, in the order of the file.
pub const HEAD: &str = "HEAD";
pub const TREE: &str = "TREE";
pub const DENSITIES: &str = "DENS";
pub const LEVELS: &str = "LEVL";
pub const CONSTANTS: &str = "BASE";
pub const TABLE: &str = "BOOK";
pub const ROWS: &str = "ROWS";
pub const BINS: &str = "BINS";

/// Size of the section `HEAD` in bytes.
pub const HEAD_BYTES: usize = 88;
