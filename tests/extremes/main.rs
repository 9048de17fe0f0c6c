//! Arithmetic where it gets thin: through the real renderer, against float64 or what can be worked out by hand.

mod fields;
mod looks;
mod places;
mod random;
mod stage;
