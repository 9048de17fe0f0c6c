//! Gives leaves the rows of earlier leaves where that costs less than rows of their own.

use rayon::prelude::*;

use super::{
    leaves::Leaves,
    search::{features, write_query},
};
use crate::file::{RECENT, Recent};
use crate::sampling::{Canceled, Progress};

/// The number of leaves that are processed one after another. The first of them know no rows of earlier leaves.
const CHUNK: usize = 4096;

/// The costs of naming a leaf's row, in bits.
pub(super) struct Costs {
    /// Of naming one of the last rows.
    pub recent: [f32; RECENT],
    /// Of saying that it is none of them.
    pub other: f32,
    /// Of then naming each row.
    pub rows: Vec<f32>,
}

impl Costs {
    /// Guesses them for a codebook of `count` rows.
    pub fn guess(count: usize) -> Self {
        Self { recent: [1.5, 3.0, 4.0, 5.0], other: 1.5, rows: vec![0.0; count] }
    }

    /// Returns the costs of a codebook of `count` rows, if leaves have these.
    pub fn of(rows: &[u16], count: usize) -> Self {
        let (mut places, mut others) = ([0u32; RECENT], vec![0u32; count]);
        let mut recent = Recent::default();
        for row in rows {
            match recent.find(*row) {
                Some(place) => places[place] += 1,
                None => others[usize::from(*row)] += 1,
            }
        }
        let bits = |count: u32, total: f32| (total / (count as f32 + 0.5)).log2();
        let other: u32 = others.iter().sum();
        let total = rows.len() as f32 + 0.5 * (RECENT + 1) as f32;
        let total_other = other as f32 + 0.5 * count as f32;
        Self {
            recent: places.map(|count| bits(count, total)),
            other: bits(other, total),
            rows: others.into_iter().map(|count| bits(count, total_other)).collect(),
        }
    }
}

/// Returns the row of every leaf: `best` or one of the last rows, whichever costs less, counting error and bits.
pub(super) fn reuse(
    leaves: &Leaves,
    table: &[f32],
    costs: &Costs,
    best: &[u16],
    progress: &Progress,
) -> Result<Vec<u16>, Canceled> {
    let features: Vec<Vec<f32>> = table.chunks_exact(leaves.width()).map(|row| features(leaves, row, 0.0)).collect();
    let of_chunk = |(chunk, best): (usize, &[u16])| {
        progress.check()?;
        let (mut moments, mut query) = (Vec::new(), Vec::new());
        let mut recent = Recent::default();
        let of_leaf = |(leaf, best): (usize, &u16)| {
            write_query(leaves, leaf, &mut moments, &mut query);
            let error = |row: u16| -> f32 { features[usize::from(row)].iter().zip(&query).map(|(a, b)| a * b).sum() };
            let (mut row, mut least) = (*best, error(*best) + costs.other + costs.rows[usize::from(*best)]);
            for (other, bits) in recent.rows().into_iter().zip(costs.recent) {
                let cost = error(other) + bits;
                if cost < least {
                    (row, least) = (other, cost);
                }
            }
            recent.find(row);
            row
        };
        Ok((chunk * CHUNK..).zip(best).map(of_leaf).collect())
    };
    let rows: Vec<Vec<u16>> = best.par_chunks(CHUNK).enumerate().map(of_chunk).collect::<Result<_, Canceled>>()?;
    Ok(rows.concat())
}
