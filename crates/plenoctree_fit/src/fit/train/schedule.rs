//! The schedule of training: the length, the rates and the penalties of each stage.

use std::time::Duration;

use super::{
    update::{Optimizer, Penalties, Rates},
    visibility::Limits,
};
use crate::fit::settings::FitSettings;

/// The first stage's voxels per side.
const COARSEST: u32 = 64;
/// Rays of each stage with an effort of 1, from the coarsest, in millions.
const RAYS: [f64; 5] = [4.0, 24.0, 110.0, 300.0, 600.0];

/// The last stage to which neighbors of visible voxels are added: later ones would have too many voxels.
const LAST_SPREAD: usize = 2;
/// The fraction of a stage that the result is not a mean of: until voxels have been removed for the last time.
const AVERAGE_FROM: f64 = 0.86;
/// Rays that refine a field with an effort of 1 at most, in millions.
const REFINING_RAYS: f64 = 60.0;
/// The most rounds of refining.
const ROUNDS: u32 = 10;
/// The fraction of such a round that its result is not a mean of.
const ROUND_AVERAGE_FROM: f64 = 0.5;
/// Rays that simplify a field with an effort of 1, in millions.
const SIMPLIFYING_RAYS: f64 = 8.0;

/// The position of a fit in its schedule.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Position {
    /// The stage.
    pub stage: usize,
    /// Rays that the stage trained on.
    pub rays: u64,
    /// Voxels that these rays crossed.
    pub samples: u64,
    /// Number of times that the stage has removed invisible voxels.
    pub prunings: usize,
    /// Seconds that the stage has taken.
    pub seconds: f64,
}

/// The stages of a fit.
#[derive(Clone, Debug)]
pub struct Schedule {
    pub stages: Vec<Stage>,
}

/// A part of a fit in which voxels have one size.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Voxels per side.
    pub resolution: u32,
    /// Rays to train on, unless there is a time.
    rays: u64,
    /// Time to train for.
    time: Option<Duration>,
    /// Tiles of a batch.
    pub tiles: usize,
    /// The fractions of the stage after which invisible voxels are removed.
    pub prune_at: Vec<f64>,
    /// The limits of visibility for that.
    pub prune_below: Limits,
    /// The largest weight of a voxel of the stage before, above which it is split.
    pub split_above: f32,
    /// Which neighbors of these voxels are split, too.
    pub spread: Spread,
    /// The fraction of the stage from which on the result is the mean over batches. Otherwise, it is the last batch's.
    pub average_from: Option<f64>,
    /// Whether exposures are learned.
    pub learns_gains: bool,
    /// Rates at the start; penalties.
    pub optimizer: Optimizer,
    /// Rates at the end.
    last: Rates,
}

/// The neighbors of voxels that are split together with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spread {
    /// None.
    None,
    /// Those that exist.
    Existing,
    /// All.
    All,
}

impl Schedule {
    /// Plans the stages. Photographs without opacity need smoother fields.
    pub fn new(settings: &FitSettings, opaque: bool) -> Self {
        let count = (settings.depth - COARSEST.ilog2() + 1) as usize;
        let total: f64 = RAYS[..count].iter().sum();
        let penalties = if opaque {
            Penalties { variation: 5e-3, presence: 1e-4, direction: 1e-3, color: 0.0 }
        } else {
            Penalties { variation: 1e-3, presence: 1e-4, direction: 1e-4, color: 0.0 }
        };
        let stages = (0..count)
            .map(|index| Stage {
                resolution: COARSEST << index,
                rays: (RAYS[index] * 1e6 * settings.effort) as u64,
                time: settings.time.map(|time| time.mul_f64(RAYS[index] / total)),
                tiles: [256, 512, 1024][index.min(2)],
                prune_at: if index == 0 { vec![0.5] } else { vec![0.1, 0.4, 0.85] },
                prune_below: Limits::default(),
                split_above: if index <= LAST_SPREAD { 0.01 } else { 0.03 },
                spread: if index > LAST_SPREAD {
                    Spread::None
                } else if opaque {
                    Spread::Existing
                } else {
                    Spread::All
                },
                average_from: Some(AVERAGE_FROM),
                learns_gains: opaque,
                optimizer: Optimizer {
                    rates: Rates { constant: 0.25, directional: 0.08, thickness: 0.06 },
                    penalties,
                    decay: 0.99,
                    floor: 1e-8,
                },
                last: Rates { constant: 0.02, directional: 0.006, thickness: 0.004 },
            })
            .collect();
        Self { stages }
    }

    /// Returns the fraction of all work that is done before `stage`, and the fraction that is this stage's.
    pub fn shares(&self, stage: usize) -> (f64, f64) {
        let total: f64 = self.stages.iter().map(|stage| stage.rays as f64).sum();
        let before: f64 = self.stages[..stage].iter().map(|stage| stage.rays as f64).sum();
        (before / total, self.stages[stage].rays as f64 / total)
    }
}

impl Stage {
    /// Plans the rounds of refining a field that is already nearly right. It may end after any of them.
    pub fn refining(resolution: u32, effort: f64, time: Option<Duration>) -> Vec<Self> {
        let mut whole = Self::gentle(resolution);
        // Larger first steps would lose what later rounds must gain again.
        whole.optimizer.rates = Rates { constant: 0.02, directional: 0.007, thickness: 0.005 };
        let rates = |round: u32| whole.rates(f64::from(round) / f64::from(ROUNDS));
        let round = |round: u32| Self {
            rays: (REFINING_RAYS * 1e6 * effort / f64::from(ROUNDS)) as u64,
            time: time.map(|time| time / ROUNDS),
            average_from: Some(ROUND_AVERAGE_FROM),
            optimizer: Optimizer { rates: rates(round), ..whole.optimizer },
            last: rates(round + 1),
            ..whole.clone()
        };
        (0..ROUNDS).map(round).collect()
    }

    /// Plans a stage for a field that is already nearly right, without rays.
    fn gentle(resolution: u32) -> Self {
        Self {
            resolution,
            rays: 0,
            time: None,
            tiles: 1024,
            prune_at: Vec::new(),
            prune_below: Limits::FAINTEST,
            split_above: 0.01,
            spread: Spread::None,
            average_from: None,
            learns_gains: false,
            optimizer: Optimizer {
                rates: Rates { constant: 0.06, directional: 0.02, thickness: 0.015 },
                penalties: Penalties { variation: 2e-5, presence: 5e-5, direction: 0.0, color: 0.0 },
                decay: 0.99,
                floor: 1e-8,
            },
            last: Rates { constant: 0.01, directional: 0.003, thickness: 0.002 },
        }
    }

    /// Plans the single stage of simplifying a field. `direction` and `color` are penalties.
    pub fn simplifying(resolution: u32, effort: f64, direction: f32, color: f32) -> Self {
        let stage = Self::gentle(resolution);
        let penalties = Penalties { direction, color, ..stage.optimizer.penalties };
        Self {
            rays: (SIMPLIFYING_RAYS * 1e6 * effort) as u64,
            prune_at: vec![0.0, 0.35],
            prune_below: Limits::default(),
            optimizer: Optimizer { penalties, ..stage.optimizer },
            ..stage
        }
    }

    /// Returns the fraction of the stage that is done.
    pub fn fraction(&self, position: &Position) -> f64 {
        match self.time {
            Some(time) => position.seconds / time.as_secs_f64().max(1e-3),
            None => position.rays as f64 / self.rays.max(1) as f64,
        }
    }

    /// Returns the rates after a fraction of the stage. They fall exponentially.
    pub fn rates(&self, fraction: f64) -> Rates {
        let first = self.optimizer.rates;
        let between = |first: f32, last: f32| first * (last / first).powf(fraction as f32);
        Rates {
            constant: between(first.constant, self.last.constant),
            directional: between(first.directional, self.last.directional),
            thickness: between(first.thickness, self.last.thickness),
        }
    }

    /// Returns the rate of the backdrop after a fraction of the stage.
    pub fn backdrop_rate(&self, fraction: f64) -> f32 {
        0.004 * 0.1f32.powf(fraction as f32)
    }
}
