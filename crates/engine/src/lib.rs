//! The features of the engine that the tests use. The demo depends on this package, which is empty, so that a build of
//! one serves the other. A test of the `lab` compares their builds.
