//! Helpers that the tests of several modules share.

#[cfg(feature = "headless")]
pub(crate) mod layouts;
pub(crate) mod log;
