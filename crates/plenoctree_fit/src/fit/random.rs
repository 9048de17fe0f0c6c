//! Random numbers that are the same on every machine.

pub use plenoctree::random::Random;
