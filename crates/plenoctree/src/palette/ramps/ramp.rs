//! Ramps: the palette colors of one material, from shadow to highlight.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::names::is_name;
use crate::palette::{colors::Palette, oklab::oklab};

/// The palette colors of one material, ordered from shadow to highlight. Section 3 of the method, step 12.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "bevy", derive(bevy_reflect::Reflect), reflect(Clone, Debug, PartialEq), type_path = "plenoctree")]
pub struct Ramp {
    /// A name that no other ramp of the palette has, such as `red` or `cap`. Not empty, not a number, and without `=`,
    /// `:` and control characters, so that it can be told from an index on the command line.
    pub name: String,
    /// Indices of palette colors, the darkest first. At least one, and none that another ramp of the palette has.
    pub tones: Vec<usize>,
}

/// An error that occurs when ramps do not fit a palette.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRamps {
    /// The palette has no such ramp.
    #[error("found ramp {found}, expected one of {expected} ramps, counted from 0")]
    Ramp {
        /// Index found.
        found: usize,
        /// Number of ramps.
        expected: usize,
    },
    /// The palette has no such color.
    #[error("found tone {found}, expected one of {expected} palette colors, counted from 0")]
    Tone {
        /// Index found.
        found: usize,
        /// Number of palette colors.
        expected: usize,
    },
    /// A color belongs to two ramps, or to one of them twice.
    #[error("found tone {tone} twice, expected every palette color in at most one ramp")]
    Twice {
        /// Index of the color.
        tone: usize,
    },
    /// A ramp has no tones.
    #[error("found a ramp \"{name}\" without tones, expected at least one")]
    Empty {
        /// The ramp's name.
        name: String,
    },
    /// A name is empty, a number, or has characters that it must not have.
    #[error("found the name \"{}\", expected one that is not a number, without `=`, `:` and control characters",
        found.escape_debug())]
    Name {
        /// The name found.
        found: String,
    },
    /// Two ramps have the same name.
    #[error("found two ramps with the name \"{name}\", expected different names")]
    SameName {
        /// The name.
        name: String,
    },
    /// A ramp was to be split before its first or after its last tone.
    #[error("found {found} tones for the first part, expected 1 to {}", expected.saturating_sub(1))]
    Split {
        /// Number of tones that the first part would have.
        found: usize,
        /// Number of the ramp's tones.
        expected: usize,
    },
}

/// Checks that ramps fit a palette of `colors` colors.
pub(in crate::palette) fn validate(ramps: &[Ramp], colors: usize) -> Result<(), InvalidRamps> {
    let mut seen = vec![false; colors];
    for (index, Ramp { name, tones }) in ramps.iter().enumerate() {
        if !is_name(name) {
            return Err(InvalidRamps::Name { found: name.clone() });
        }
        if ramps[..index].iter().any(|other| other.name == *name) {
            return Err(InvalidRamps::SameName { name: name.clone() });
        }
        if tones.is_empty() {
            return Err(InvalidRamps::Empty { name: name.clone() });
        }
        for &tone in tones {
            let seen = seen.get_mut(tone).ok_or(InvalidRamps::Tone { found: tone, expected: colors })?;
            if std::mem::replace(seen, true) {
                return Err(InvalidRamps::Twice { tone });
            }
        }
    }
    Ok(())
}

/// Sorts palette colors from shadow to highlight.
pub(super) fn sort(tones: &mut [usize], colors: &[[f64; 3]]) {
    let lightness = |tone: usize| oklab(DVec3::from(colors[tone])).x;
    tones.sort_by(|&a, &b| lightness(a).total_cmp(&lightness(b)).then(a.cmp(&b)));
}

impl Palette {
    /// Returns the index of the ramp with a name.
    pub fn ramp(&self, name: &str) -> Option<usize> {
        self.ramps.iter().position(|ramp| ramp.name == name)
    }

    /// Returns the index of the ramp that a palette color belongs to, or `None` if it belongs to none.
    pub fn ramp_of(&self, tone: usize) -> Option<usize> {
        self.ramps.iter().position(|ramp| ramp.tones.contains(&tone))
    }

    /// Renames a ramp.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if there is no such ramp, or if it cannot have the name.
    pub fn rename_ramp(&mut self, ramp: usize, name: impl Into<String>) -> Result<(), InvalidRamps> {
        let name = name.into();
        self.check_ramp(ramp)?;
        if !is_name(&name) {
            return Err(InvalidRamps::Name { found: name });
        }
        if self.ramp(&name).is_some_and(|other| other != ramp) {
            return Err(InvalidRamps::SameName { name });
        }
        self.ramps[ramp].name = name;
        Ok(())
    }

    /// Adds the tones of the ramp `from` to the ramp `into`, and removes `from`. Later ramps move up by one.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if there is no such ramp.
    pub fn merge_ramps(&mut self, into: usize, from: usize) -> Result<(), InvalidRamps> {
        self.check_ramp(into)?;
        self.check_ramp(from)?;
        if into != from {
            let tones = std::mem::take(&mut self.ramps[from].tones);
            self.ramps[into].tones.extend(tones);
            sort(&mut self.ramps[into].tones, &self.colors);
            self.ramps.remove(from);
        }
        Ok(())
    }

    /// Splits a ramp: it keeps its `first` darkest tones, and a new ramp, the last one, gets the others and `name`.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if there is no such ramp, if a part would be empty, or if no ramp can have
    /// the name.
    pub fn split_ramp(&mut self, ramp: usize, first: usize, name: impl Into<String>) -> Result<(), InvalidRamps> {
        let name = name.into();
        self.check_ramp(ramp)?;
        let expected = self.ramps[ramp].tones.len();
        if first == 0 || first >= expected {
            return Err(InvalidRamps::Split { found: first, expected });
        }
        if !is_name(&name) {
            return Err(InvalidRamps::Name { found: name });
        }
        if self.ramp(&name).is_some() {
            return Err(InvalidRamps::SameName { name });
        }
        let tones = self.ramps[ramp].tones.split_off(first);
        self.ramps.push(Ramp { name, tones });
        Ok(())
    }

    /// Moves a palette color to a ramp, whichever ramp it was in. A ramp that loses its last tone is removed, and later
    /// ramps move up by one.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if there is no such color or no such ramp.
    pub fn move_tone(&mut self, tone: usize, ramp: usize) -> Result<(), InvalidRamps> {
        self.check_ramp(ramp)?;
        if tone >= self.colors.len() {
            return Err(InvalidRamps::Tone { found: tone, expected: self.colors.len() });
        }
        self.ramps.iter_mut().for_each(|ramp| ramp.tones.retain(|other| *other != tone));
        self.ramps[ramp].tones.push(tone);
        sort(&mut self.ramps[ramp].tones, &self.colors);
        self.ramps.retain(|ramp| !ramp.tones.is_empty());
        Ok(())
    }

    /// Gathers palette colors in the ramp with a name, whichever ramps they were in. If there is no such ramp, a new one,
    /// the last, gets them. Ramps that lose their last tone are removed, and later ramps move up.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if there is no such color, if none are given, or if no ramp can have the
    /// name.
    ///
    /// ```
    /// # use plenoctree::palette::{InvalidRamps, Palette};
    /// # let mut palette = Palette::new(vec![[0.2, 0.1, 0.1], [0.8, 0.4, 0.4]]).unwrap();
    /// palette.gather_tones(&[1, 0], "cap")?;
    /// assert_eq!(palette.ramps[0].tones, [0, 1]);
    /// # Ok::<(), InvalidRamps>(())
    /// ```
    pub fn gather_tones(&mut self, tones: &[usize], name: impl Into<String>) -> Result<(), InvalidRamps> {
        let (name, expected) = (name.into(), self.colors.len());
        if let Some(&found) = tones.iter().find(|tone| **tone >= expected) {
            return Err(InvalidRamps::Tone { found, expected });
        }
        if !is_name(&name) {
            return Err(InvalidRamps::Name { found: name });
        }
        if tones.is_empty() {
            return Err(InvalidRamps::Empty { name });
        }
        self.ramps.iter_mut().for_each(|ramp| ramp.tones.retain(|tone| !tones.contains(tone)));
        let ramp = self.ramp(&name).unwrap_or_else(|| {
            self.ramps.push(Ramp { name, tones: vec![] });
            self.ramps.len() - 1
        });
        let gathered = &mut self.ramps[ramp].tones;
        gathered.extend_from_slice(tones);
        sort(gathered, &self.colors);
        gathered.dedup();
        self.ramps.retain(|ramp| !ramp.tones.is_empty());
        Ok(())
    }

    fn check_ramp(&self, ramp: usize) -> Result<(), InvalidRamps> {
        let expected = self.ramps.len();
        if ramp < expected { Ok(()) } else { Err(InvalidRamps::Ramp { found: ramp, expected }) }
    }
}
