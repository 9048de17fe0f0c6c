//! The plan of a view's frame: everything that is decided, in one place. Passes read it and decide nothing.

mod decide;
mod levels;
mod motion;
mod overlap;
mod steady;
mod view;

pub(super) use decide::{Known, decide};
#[cfg(feature = "shadows")]
pub(super) use decide::{covered, extent};
pub(super) use levels::choose_levels;
#[cfg(feature = "shadows")]
pub(super) use levels::levels_coarser;
pub(crate) use view::PropView;
pub(super) use view::{Overlap, Plan, PlanValues, PlannedProp, Target, drawn_viewport};
