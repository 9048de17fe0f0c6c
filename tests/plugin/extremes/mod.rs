//! Tests arithmetic at its limits, against the float64 reference or values worked out by hand.

mod fields;
mod places;
mod posterize;
mod random;
mod stage;
