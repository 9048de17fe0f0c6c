//! Helpers that the tests of several modules share.

pub(crate) mod layouts;
pub(crate) mod log;
