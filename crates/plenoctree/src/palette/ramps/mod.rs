//! Ramps: which palette colors are shades of one material, and how they change together.

mod adjustment;
mod borders;
mod edit;
mod gamut;
mod group;
mod motion;
mod names;
mod soft;
#[cfg(test)]
mod tests;
mod wishes;

pub use adjustment::RampAdjustment;
pub use wishes::{Unmet, UnmetReason, UnmetWishes, Wish};

use super::{colors::Palette, ramp::Ramp};
use crate::sampling::View;
use borders::Borders;

impl Palette {
    /// Returns the ramps that the palette's colors form in views of the field, the heaviest first, as section 3 of the
    /// method says, step 12. Every color is in one of them.
    pub(super) fn ramps_in_views(&self, views: &[View]) -> Vec<Ramp> {
        group::group(self, &Borders::of(views, self))
    }

    /// Returns the ramps that the palette's colors seem to form, the heaviest first, without a field to look at:
    /// materials of similar hue and chroma are not told apart, and tinted shadows and highlights may be left out.
    pub fn guess_ramps(&self) -> Vec<Ramp> {
        group::group(self, &Borders::none(self.colors.len()))
    }
}
