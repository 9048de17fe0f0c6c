//! The plan of a view's frame: everything that is decided, in one place. Passes read it and decide nothing.

mod ahead;
mod decide;
mod motion;
mod overlap;
mod view;

pub(super) use ahead::{choose_levels, look_ahead};
pub(super) use decide::{Known, decide};
pub(super) use view::{BATCH, Feature, Kind, Plan, PlannedProp, SPACING, batches, drawn_viewport};
