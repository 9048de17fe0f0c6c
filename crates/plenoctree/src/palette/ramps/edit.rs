//! Changes which palette colors ramps consist of, and their names.

use crate::palette::{
    colors::Palette,
    ramp::{InvalidRamps, Ramp, is_name, sort},
};

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

    /// Moves a palette color to a ramp, whichever ramp it was in. A ramp that loses its last tone is removed, and later
    /// ramps move up by one.
    ///
    /// # Errors
    ///
    /// Returns an error, and changes nothing, if there is no such color or no such ramp.
    pub fn move_tone(&mut self, tone: usize, ramp: usize) -> Result<(), InvalidRamps> {
        self.check_ramp(ramp)?;
        self.gather_tones(&[tone], self.ramps[ramp].name.clone())
    }

    /// Gathers palette colors in the ramp with a name, whichever ramps they were in: all those of several ramps to merge
    /// these, or some of one to split it. If there is no such ramp, a new one, the last, gets them. Ramps that lose
    /// their last tone are removed, and later ramps move up.
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
