//! The part of a capture that becomes a field.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::{axis::Axis, error::SplatError, splats::Splats};

/// Settings of [`Splats::subject`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SubjectSettings {
    /// Lowest and highest corner of a box around the subject, in the coordinates of the capture. All visible
    /// Gaussians whose centers are in it count. By default, the box contains most Gaussians ([`Splats::dense_bounds`]).
    pub crop: Option<(DVec3, DVec3)>,
    /// Keep only the largest connected part, without floaters and backgrounds.
    pub keep_largest: bool,
    /// The direction that is up in the capture: the subject is turned so that this becomes z. By default, it is not
    /// turned.
    pub up: Option<Axis>,
}

/// The part of a capture to convert to a field.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Its Gaussians.
    pub splats: Splats,
    /// Lowest corner of the box to convert.
    pub low: DVec3,
    /// Highest corner of the box to convert.
    pub high: DVec3,
    /// The rotation from the coordinates of the capture to those of the subject.
    pub turn: DMat3,
}

impl Splats {
    /// Returns the part of the capture to convert to a field, for [`voxelize()`](super::voxelize()).
    ///
    /// # Errors
    ///
    /// Returns an error if the box is not a lowest and a highest corner, or if nothing in it is visible.
    pub fn subject(self, settings: &SubjectSettings) -> Result<Subject, SplatError> {
        let upright = |up: Axis| DMat3::from_quat(DQuat::from_rotation_arc(up.direction(), DVec3::Z));
        let turn = settings.up.map_or(DMat3::IDENTITY, upright);
        let mut splats = match settings.crop {
            Some((low, high)) if !low.cmplt(high).all() => {
                return Err(SplatError::Setting {
                    setting: "crop",
                    found: format!("{low} to {high}"),
                    expected: "a lowest and a highest corner",
                });
            }
            Some((low, high)) => self.cropped(low, high),
            None => self,
        };
        if turn != DMat3::IDENTITY {
            splats = splats.transformed(DAffine3::from_mat3(turn));
        }
        let place = if settings.crop.is_some() { "the box to crop to" } else { "the file" };
        // Rotations map axes to axes, so the box stays aligned to them.
        let crop = settings.crop.map(|(low, high)| (turn * low, turn * high));
        let crop = crop.map(|(first, last)| (first.min(last), first.max(last)));
        // Everything in a box that was chosen counts, also what is far from the rest.
        let bounds = |splats: &Splats| {
            let found = crop.map_or_else(|| splats.dense_bounds(), |(low, high)| splats.bounds_in(low, high));
            found.ok_or_else(|| SplatError::Empty { place: place.into() })
        };
        let (mut low, mut high) = bounds(&splats)?;
        splats = splats.cropped(low, high);
        if settings.keep_largest {
            splats = splats.largest_part(low, high);
            (low, high) = bounds(&splats)?;
        }
        if let Some((first, last)) = crop {
            (low, high) = (low.max(first), high.min(last));
        }
        Ok(Subject { splats, low, high, turn })
    }
}
