//! Moves ramps so that given labels get given colors: section 4 of the method, step 8.

use glam::{DVec2, DVec3};

use super::{
    adjustment::{LEAST_CONTRAST, room},
    gamut,
    motion::{Motion, Shades},
};
use crate::{
    cholesky,
    palette::{
        colors::Palette,
        label::PaletteLabel,
        oklab::{from_oklab, oklab},
    },
};

/// A wish that a label, and so the pixels that have it, gets a color.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// The label: a palette color, or a blend of two.
    pub label: PaletteLabel,
    /// The color that it should get, in encoded sRGB.
    pub color: [f64; 3],
}

impl Wish {
    /// Returns the wish that a palette color becomes another color in encoded sRGB.
    pub fn tone(tone: usize, color: [f64; 3]) -> Self {
        Self { label: PaletteLabel { index: tone, first: tone, second: tone, share: 1.0 }, color }
    }
}

/// Some wishes cannot be met.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", unmet.iter().map(|unmet| format!("wish {} {unmet}", unmet.wish)).collect::<Vec<_>>().join("; "))]
pub struct UnmetWishes {
    /// The wishes that are not met, in order.
    pub unmet: Vec<Unmet>,
    /// The palette's colors in encoded sRGB with which all wishes together are met best, in least squares.
    pub nearest: Vec<[f64; 3]>,
}

/// A wish that is not met. Its message says why, without its index.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("cannot be met: {reason}{}", self.nearest())]
pub struct Unmet {
    /// Its index among the wishes.
    pub wish: usize,
    /// The color in encoded sRGB that is nearest to what was wished, if the wish makes sense.
    pub reached: Option<[f64; 3]>,
    /// Why it is not met.
    pub reason: UnmetReason,
}

impl Unmet {
    fn nearest(&self) -> String {
        self.reached.map(|[r, g, b]| format!(" (nearest: {r:.3}, {g:.3}, {b:.3})")).unwrap_or_default()
    }
}

/// Why a wish is not met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnmetReason {
    /// The palette has no such label.
    #[error("found color {index}, expected an index below {colors}")]
    NoLabel {
        /// The index of a color of the label.
        index: usize,
        /// The number of colors of the palette.
        colors: usize,
    },
    /// The color, or the share of the label, is not finite.
    #[error("found a color or a share that is not finite")]
    NotFinite,
    /// The label's ramps are locked, or its colors are in no ramp.
    #[error("its colors are in no ramp that may move")]
    Locked,
    /// Other wishes pull the ramp elsewhere, or the color is none that the ramp can get.
    #[error("it contradicts another wish, or the ramp cannot get there")]
    Conflict,
}

/// The difference of a channel in encoded sRGB up to which a wish is met.
const MET: f64 = 1e-3;
/// The error in Oklab at which the solver stops.
const EXACT: f64 = 1e-9;
/// Number of parameters of a motion: the mean, the contrast and the tint.
const PARAMETERS: usize = 6;
/// How readily each parameter changes.
const EASE: [f64; PARAMETERS] = [1.0, 1.0, 1.0, 0.3, 0.3, 0.3];

impl Palette {
    /// Returns what the palette's colors show after its ramps have moved so that all wishes come true, with as little
    /// change of their source colors as possible. All colors are in encoded sRGB.
    ///
    /// Ramps without a wish, those in `locked`, and colors in no ramp keep showing `shown`, or their source colors if
    /// it is shorter.
    ///
    /// A single wish for a ramp moves it as a whole, like [`show_ramp`](Self::show_ramp). Several also change its
    /// contrast and the tint of its shadows.
    ///
    /// ```
    /// use plenoctree::palette::{Palette, Wish};
    ///
    /// let mut palette = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.9, 0.9, 0.9]])?;
    /// palette.ramps = palette.guess_ramps();
    /// let shown = palette.recolored(&palette.colors, &[Wish::tone(0, [0.1, 0.1, 0.4])], &[])?;
    /// assert_eq!(shown[0], [0.1, 0.1, 0.4]);
    /// // The lighter red became a lighter blue.
    /// assert!(shown[1][2] > shown[0][2] && shown[1][2] > shown[1][0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Returns an error that says which wishes cannot be met, and with the colors that are nearest to all of them.
    pub fn recolored(
        &self,
        shown: &[[f64; 3]],
        wishes: &[Wish],
        locked: &[usize],
    ) -> Result<Vec<[f64; 3]>, UnmetWishes> {
        let fault = |wish: &Wish| {
            let PaletteLabel { first, second, share, .. } = wish.label;
            let (index, colors) = (first.max(second), self.colors.len());
            match index < colors {
                false => Some(UnmetReason::NoLabel { index, colors }),
                true if share.is_finite() && DVec3::from(wish.color).is_finite() => None,
                true => Some(UnmetReason::NotFinite),
            }
        };
        let known: Vec<Wish> = wishes.iter().copied().filter(|wish| fault(wish).is_none()).collect();
        let shown = shown.iter().chain(self.colors.iter().skip(shown.len())).take(self.colors.len()).copied().collect();
        let colors = Solver::new(self, shown, &known, locked).solve();
        let mut unmet = Vec::new();
        for (index, wish) in wishes.iter().enumerate() {
            if let Some(reason) = fault(wish) {
                unmet.push(Unmet { wish: index, reached: None, reason });
                continue;
            }
            let reached = wish.label.mix(&colors);
            if (reached - DVec3::from(wish.color)).abs().max_element() > MET || reached.is_nan() {
                let may_move = |tone| self.ramp_of(tone).is_some_and(|ramp| !locked.contains(&ramp));
                let is_free = may_move(wish.label.first) || may_move(wish.label.second);
                let reason = if is_free { UnmetReason::Conflict } else { UnmetReason::Locked };
                unmet.push(Unmet { wish: index, reached: Some(reached.into()), reason });
            }
        }
        if unmet.is_empty() { Ok(colors) } else { Err(UnmetWishes { unmet, nearest: colors }) }
    }
}

struct Solver<'a> {
    /// What colors show that do not move.
    shown: Vec<[f64; 3]>,
    wishes: &'a [Wish],
    /// The ramps that move.
    ramps: Vec<(Shades<'a>, Motion)>,
}

impl<'a> Solver<'a> {
    fn new(palette: &'a Palette, shown: Vec<[f64; 3]>, wishes: &'a [Wish], locked: &[usize]) -> Self {
        let wished = |ramp: &usize| {
            let has = |tone| palette.ramps[*ramp].tones.contains(&tone);
            wishes.iter().any(|wish| has(wish.label.first) || has(wish.label.second))
        };
        let free = (0..palette.ramps.len()).filter(|ramp| !locked.contains(ramp)).filter(wished);
        let still = |shades: Shades<'a>| {
            let motion = Motion { mean: shades.mean(), contrast: 1.0, spread: 1.0, tint: DVec2::ZERO };
            (shades, motion)
        };
        Self { shown, wishes, ramps: free.filter_map(|ramp| Shades::of(palette, ramp)).map(still).collect() }
    }

    /// Returns the colors that meet the wishes best.
    fn solve(mut self) -> Vec<[f64; 3]> {
        // The means alone, then with less contrast where that does not fit between black and white.
        self.improve(3);
        let limited = self.wishes.iter().all(|wish| wish.color.iter().all(|channel| (0.0..=1.0).contains(channel)));
        if limited {
            for (shades, motion) in &mut self.ramps {
                let (below, above) = shades.reach();
                motion.contrast = room(motion.mean.x, below, 1.0 - motion.mean.x, above).clamp(LEAST_CONTRAST, 1.0);
            }
            self.improve(3);
        }
        if self.error() > EXACT {
            self.improve(PARAMETERS);
        }
        let mut colors = self.shown.clone();
        self.place(|tone, place| colors[tone] = gamut::shown(place, limited));
        // What is met but for rounding is met to the bit. Colors that may not move keep what they show.
        let moves = |tone| self.ramps.iter().any(|(shades, _)| shades.tones().any(|other| other == tone));
        for wish in self.wishes.iter().filter(|wish| moves(wish.label.first)) {
            let tone = wish.label.first;
            let near = |color: [f64; 3]| (DVec3::from(color) - DVec3::from(wish.color)).abs().max_element() <= MET;
            if tone == wish.label.second && near(colors[tone]) {
                colors[tone] = wish.color;
            }
        }
        colors
    }

    fn place(&self, mut place: impl FnMut(usize, DVec3)) {
        self.ramps.iter().for_each(|(shades, motion)| shades.place(motion, &mut place));
    }

    /// Returns how far every wish is from coming true, in Oklab.
    fn residuals(&self) -> Vec<f64> {
        let mut places: Vec<DVec3> = self.shown.iter().map(|color| oklab((*color).into())).collect();
        self.place(|tone, place| places[tone] = place);
        let residual = |wish: &Wish| {
            let PaletteLabel { first, second, share, .. } = wish.label;
            let place = if first == second {
                places[first]
            } else {
                oklab(share * from_oklab(places[first]) + (1.0 - share) * from_oklab(places[second]))
            };
            (oklab(wish.color.into()) - place).to_array()
        };
        self.wishes.iter().flat_map(residual).collect()
    }

    fn error(&self) -> f64 {
        self.residuals().iter().map(|residual| residual * residual).sum::<f64>().sqrt()
    }

    /// Meets the wishes in least squares with the first `free` parameters of every ramp: Gauss-Newton, each step the
    /// shortest one.
    fn improve(&mut self, free: usize) {
        for _ in 0..30 {
            let residuals = self.residuals();
            let error = self.error();
            if error <= EXACT || residuals.is_empty() {
                return;
            }
            let columns = self.columns(free, &residuals);
            let step = shortest(&columns, &residuals);
            let before: Vec<Motion> = self.ramps.iter().map(|(_, motion)| *motion).collect();
            let mut length = 1.0;
            loop {
                for (index, (change, (_, ease))) in step.iter().zip(&columns).enumerate() {
                    let (ramp, parameter) = (index / free, index % free);
                    if parameter == 0 {
                        self.ramps[ramp].1 = before[ramp];
                    }
                    change_parameter(&mut self.ramps[ramp].1, parameter, length * ease * change);
                }
                if self.error() < error * (1.0 - 1e-9) {
                    break;
                }
                length *= 0.5;
                if length < 1e-4 {
                    self.ramps.iter_mut().zip(before).for_each(|((_, motion), before)| *motion = before);
                    return;
                }
            }
        }
    }

    /// Returns the change of what is reached by every parameter, scaled by how readily it changes, and that scale.
    fn columns(&mut self, free: usize, residuals: &[f64]) -> Vec<(Vec<f64>, f64)> {
        const SMALL: f64 = 1e-6;
        let mut columns = Vec::new();
        for ramp in 0..self.ramps.len() {
            for (parameter, ease) in EASE.into_iter().enumerate().take(free) {
                let before = self.ramps[ramp].1;
                change_parameter(&mut self.ramps[ramp].1, parameter, SMALL);
                let column = residuals.iter().zip(self.residuals()).map(|(a, b)| ease * (a - b) / SMALL).collect();
                self.ramps[ramp].1 = before;
                columns.push((column, ease));
            }
        }
        columns
    }
}

/// Changes a parameter of a motion. Light and dark never swap.
fn change_parameter(motion: &mut Motion, parameter: usize, by: f64) {
    match parameter {
        0..3 => motion.mean[parameter] += by,
        3 => motion.contrast = (motion.contrast + by).max(0.0),
        _ => motion.tint[parameter - 4] += by,
    }
}

/// Returns the shortest combination of columns that comes nearest to `target`.
fn shortest(columns: &[(Vec<f64>, f64)], target: &[f64]) -> Vec<f64> {
    let rows = target.len();
    let product = |a: usize, b: usize| columns.iter().map(|(column, _)| column[a] * column[b]).sum::<f64>();
    let mut matrix: Vec<f64> = (0..rows * rows).map(|place| product(place / rows, place % rows)).collect();
    let diagonal = |row: usize| row * rows + row;
    // Wishes that depend on each other make the matrix singular.
    let ridge = 1e-10 * (0..rows).map(|row| matrix[diagonal(row)]).fold(0.0, f64::max);
    (0..rows).for_each(|row| matrix[diagonal(row)] += ridge);
    cholesky::decompose(&mut matrix, rows);
    let mut solution = target.to_vec();
    cholesky::solve(&matrix, &mut solution);
    columns.iter().map(|(column, _)| column.iter().zip(&solution).map(|(a, b)| a * b).sum()).collect()
}
