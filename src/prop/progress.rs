//! The progress of props on their way to the screen.

use bevy::prelude::*;

/// The progress of a [`Prop`](crate::Prop) on its way to the screen. For loading screens,
/// [`props_progress`](crate::props_progress) averages it over all fields.
///
/// Every prop has this component; do not change it. It is updated together with [`PropState`](crate::PropState), and
/// marked as changed only when it changes. While a prop waits for a field, its fractions never fall. When a prop is
/// ready or has failed, all are 1. Saved worlds do not contain it.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PropProgress {
    /// The fraction of the field's file that has been read and parsed, from 0 to 1. Asset sources that cannot seek
    /// return whole files, so it jumps from 0 to 1.
    pub read: f32,
    /// The fraction of the field that is on the GPU, from 0 to 1. It is 0 while the field is prepared in the
    /// background.
    pub uploaded: f32,
    /// The progress of the palette's extraction, from 0 to 1, or `None` if the prop needs no palette.
    pub palette: Option<f32>,
}

impl PropProgress {
    /// Returns the mean of the fractions, from 0 to 1.
    pub fn fraction(&self) -> f32 {
        match self.palette {
            Some(palette) => (self.read + self.uploaded + palette) / 3.0,
            None => (self.read + self.uploaded) / 2.0,
        }
    }

    /// Returns the larger of each fraction.
    pub(crate) fn max(self, other: Self) -> Self {
        let palette = self.palette.map(|palette| palette.max(other.palette.unwrap_or(0.0)));
        Self { read: self.read.max(other.read), uploaded: self.uploaded.max(other.uploaded), palette }
    }
}
