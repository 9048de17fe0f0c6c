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
const RAYS: [f64; 5] = [4.0, 24.0, 50.0, 90.0, 150.0];
/// The time that a ray takes in each stage, relative to the first.
const COSTS: [f64; 5] = [1.0, 1.0, 2.0, 3.0, 4.0];

/// How many times more voxels a stage may start with than the field may have: most of them turn out to be invisible.
const OVERFULL: usize = 3;
/// The fraction of a stage that the result is not a mean of: until voxels have been removed for the last time.
const AVERAGE_FROM: f64 = 0.86;
/// Rays that refine a field with an effort of 1 at most, in millions.
const REFINING_RAYS: f64 = 60.0;
/// The most rounds of refining.
const ROUNDS: u32 = 10;
/// The fraction of such a round that its result is not a mean of.
const ROUND_AVERAGE_FROM: f64 = 0.5;
/// The thickness below which steps of refining are smaller.
const THIN: f32 = 0.05;
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

/// A part of a fit in which the finest voxels have one size.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Finest voxels per side.
    pub resolution: u32,
    /// Rays to train on, unless there is a time.
    rays: u64,
    /// Time to train for.
    pub time: Option<StageTime>,
    /// Tiles of a batch.
    pub tiles: usize,
    /// The fractions of the stage after which invisible voxels are removed, and the most that are kept.
    pub prune_at: Vec<(f64, usize)>,
    /// The limits of visibility for that.
    pub prune_below: Limits,
    /// The number of voxels from which on no more of the stage before are split.
    pub most_split: usize,
    /// Whether voxels are added around those that are split.
    pub adds_neighbors: bool,
    /// The fraction of the stage from which on the result is the mean over batches. Otherwise, it is the last batch's.
    pub average_from: Option<f64>,
    /// Whether exposures are learned.
    pub learns_gains: bool,
    /// Rates at the start; penalties.
    pub optimizer: Optimizer,
    /// Rates at the end.
    last: Rates,
}

/// The time of a stage, in seconds.
#[derive(Clone, Copy, Debug)]
pub struct StageTime {
    /// How long it took until training began.
    pub preparing: f64,
    /// How long to train after that.
    pub training: f64,
}

impl Schedule {
    /// Plans the stages up to this `depth`. Photographs without opacity need smoother fields.
    pub fn new(settings: &FitSettings, depth: u32, opaque: bool) -> Self {
        let count = (depth - COARSEST.ilog2() + 1) as usize;
        let variation = if opaque { 2e-2 } else { 1e-3 };
        let penalties = Penalties { variation, presence: 1e-4, direction: 1e-4, color: 0.0 };
        let more = settings.leaves.saturating_add(settings.leaves / 4);
        let stages = (0..count)
            .map(|index| Stage {
                resolution: COARSEST << index,
                rays: ((RAYS[index] * 1e6 * settings.effort) as u64).max(1),
                time: None,
                tiles: [256, 512, 1024][index.min(2)],
                prune_at: match index {
                    0 => vec![(0.5, settings.leaves)],
                    // Later, some of them are no longer visible.
                    _ => vec![(0.1, more), (0.4, more), (0.85, settings.leaves)],
                },
                prune_below: Limits { removes_clouds: opaque, ..Limits::USUAL },
                most_split: settings.leaves.saturating_mul(OVERFULL),
                adds_neighbors: !opaque,
                average_from: Some(AVERAGE_FROM),
                learns_gains: opaque,
                optimizer: Optimizer {
                    rates: Rates { constant: 0.25, directional: 0.08, thickness: 0.06 },
                    thin: 0.0,
                    penalties,
                },
                last: Rates { constant: 0.02, directional: 0.006, thickness: 0.004 },
            })
            .collect();
        Self { stages }
    }

    /// Returns the fraction of all work that is done before `stage`, and the fraction that is this stage's. All is done
    /// after the last one.
    pub fn shares(&self, stage: usize) -> (f64, f64) {
        if stage >= self.stages.len() {
            return (1.0, 0.0);
        }
        let work = |(stage, cost): (&Stage, f64)| stage.rays as f64 * cost;
        let total: f64 = self.stages.iter().zip(COSTS).map(work).sum();
        let before: f64 = self.stages[..stage].iter().zip(COSTS).map(work).sum();
        (before / total, work((&self.stages[stage], COSTS[stage])) / total)
    }
}

impl Stage {
    /// Plans the rounds of refining a field that is already nearly right. It may end after any of them.
    pub fn refining(resolution: u32, effort: f64, time: Option<Duration>) -> Vec<Self> {
        let mut whole = Self::gentle(resolution);
        // Larger first steps would lose what later rounds must gain again. Pictures of captures have no noise.
        whole.optimizer = Optimizer {
            rates: Rates { constant: 0.04, directional: 0.007, thickness: 3e-3 },
            thin: THIN,
            penalties: Penalties { variation: 0.0, presence: 0.0, direction: 0.0, color: 0.0 },
        };
        whole.last.thickness = 5e-4;
        let rates = |round: u32| whole.rates(f64::from(round) / f64::from(ROUNDS));
        let round = |round: u32| Self {
            rays: (REFINING_RAYS * 1e6 * effort / f64::from(ROUNDS)) as u64,
            time: time.map(|time| StageTime { preparing: 0.0, training: time.as_secs_f64() / f64::from(ROUNDS) }),
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
            most_split: 0,
            adds_neighbors: false,
            average_from: None,
            learns_gains: false,
            optimizer: Optimizer {
                rates: Rates { constant: 0.06, directional: 0.02, thickness: 0.015 },
                thin: 0.0,
                penalties: Penalties { variation: 2e-5, presence: 5e-5, direction: 0.0, color: 0.0 },
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
            prune_at: vec![(0.0, usize::MAX), (0.35, usize::MAX)],
            prune_below: Limits::USUAL,
            optimizer: Optimizer { penalties, ..stage.optimizer },
            ..stage
        }
    }

    /// Returns the fraction of the usual rays that the stage has trained on.
    pub fn trained(&self, position: &Position) -> f64 {
        position.rays as f64 / self.rays.max(1) as f64
    }

    /// Returns the fraction of the stage that is done.
    pub fn fraction(&self, position: &Position) -> f64 {
        match self.time {
            Some(time) => (position.seconds - time.preparing) / time.training.max(1e-3),
            None => self.trained(position),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The least effort is still a part of the work, not a part of nothing.
    #[test]
    fn the_least_effort_has_shares() {
        let settings = FitSettings { effort: 1e-12, ..FitSettings::default() };
        let schedule = Schedule::new(&settings, 8, false);
        let (before, share) = schedule.shares(1);
        assert!(before > 0.0 && share > 0.0 && before + share < 1.0, "{before} {share}");
        let positions = schedule.stages.iter().map(|stage| stage.fraction(&Position::default()));
        assert!(positions.eq([0.0; 3]));
    }
}
