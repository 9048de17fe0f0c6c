//! The plan of a view's frame: everything that is decided, in one place. Passes read it and decide nothing.

mod ahead;
mod decide;
mod levels;
mod motion;
mod overlap;
mod steady;
mod view;

pub(super) use ahead::look_ahead;
pub(super) use decide::{Known, decide};
pub(super) use levels::choose_levels;
pub(super) use view::{Feature, Kind, Plan, PlanValues, PlannedProp, SPACING, drawn_viewport};
