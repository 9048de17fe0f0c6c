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
use crate::{
    field::PlenOctree,
    sampling::{Canceled, Progress, SamplingSettings, View, ViewRays},
};
use borders::Borders;

impl Palette {
    /// Returns the ramps that the palette's colors form, the heaviest first, as section 3 of the method says, step 12.
    /// Every color is in one of them.
    ///
    /// Looks at the field from the directions of `settings` to find which colors are beside each other. On all cores,
    /// this takes a fraction of a second. The same field and palette give the same ramps.
    ///
    /// # Errors
    ///
    /// Returns an error if [`Progress::cancel`] is called.
    pub fn find_ramps(
        &self,
        field: &PlenOctree,
        settings: &SamplingSettings,
        progress: &Progress,
    ) -> Result<Vec<Ramp>, Canceled> {
        Ok(self.ramps_in_views(&View::all(field, &ViewRays::all(field, settings), progress)?))
    }

    /// Returns the ramps that the palette's colors form in views of the field: see [`find_ramps`](Self::find_ramps).
    pub(super) fn ramps_in_views(&self, views: &[View]) -> Vec<Ramp> {
        group::group(self, &Borders::of(views, self))
    }

    /// Returns the ramps that the palette's colors seem to form, the heaviest first, without a field to look at:
    /// materials of similar hue and chroma are not told apart, and tinted shadows and highlights may be left out.
    pub fn guess_ramps(&self) -> Vec<Ramp> {
        group::group(self, &Borders::none(self.colors.len()))
    }
}
