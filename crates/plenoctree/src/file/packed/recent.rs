//! The rows that leaves had last, which the next ones are likely to have.

/// How many rows are remembered.
pub(crate) const RECENT: usize = 4;

/// The rows of a codebook that leaves had last, the last one first. At first, all are the row 0.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Recent([u16; RECENT]);

impl Recent {
    /// Moves the row at `place` to the front and returns it. `place` is less than [`RECENT`].
    #[inline]
    pub fn take(&mut self, place: usize) -> u16 {
        self.0[..=place].rotate_right(1);
        self.0[0]
    }

    /// Adds a row that is not among them, and forgets the last one.
    #[inline]
    pub fn push(&mut self, row: u16) {
        self.0.rotate_right(1);
        self.0[0] = row;
    }

    /// Moves a row to the front. Returns its place, or `None` if it was not among them.
    #[cfg(feature = "write")]
    pub fn find(&mut self, row: u16) -> Option<usize> {
        let place = self.0.iter().position(|other| *other == row);
        match place {
            Some(place) => _ = self.take(place),
            None => self.push(row),
        }
        place
    }

    #[cfg(feature = "write")]
    pub fn rows(&self) -> [u16; RECENT] {
        self.0
    }
}
