//! The palette of Wang, Liu and Xu, *An Improved Geometric Approach for Palette-based Image Decomposition and
//! Recoloring* (Pacific Graphics 2019), which the paper compares itself to in figure 9.
//!
//! Their palette extraction starts at the vertices of a simplified convex hull (Tan et al.) and pulls them toward the
//! image's colors. It minimizes `lambda R + S`:
//!
//! - the reconstruction loss `R = 1/N sum_i d(c_i, P)`, the mean distance of the N colors from the polyhedron `P` of
//!   the palette, 0 for those inside;
//! - the representativeness loss `S = 1/K sum_j |v_j - m_j|`, the mean distance of the K palette colors from the
//!   centers `m_j` of the colors that are nearest to each.
//!
//! One vertex after another moves along the line from `v_j` to `m_j`, to the point with the smallest sum. Choices made
//! here:
//!
//! - `P` is the convex hull of the palette, and not a polyhedron that keeps its first faces while its vertices move. So
//!   distances are at most theirs, and a vertex inside the hull of the others costs nothing.
//! - `lambda` is 20, and `m_j` is the mean of the nearest 0.1% of the colors: the defaults of public implementations.
//! - Of the colors, 40,000 are used, evenly chosen by weight. The hull contains all.
//! - The best place on the line is the best of 16 evenly spaced ones, and a vertex stays if none is better. Rounds over
//!   all vertices end when a round gains less than 1e-5, or after 20.
//! - The number of colors is given, as for all palettes of the report, and not found from an error.

use glam::DVec3;
use plenoctree::palette::{InvalidPalette, Palette, simplify_hull};
use rayon::prelude::*;

use super::{colors::WeightedColors, solid::Solid};

/// The weight of the reconstruction loss.
const LAMBDA: f64 = 20.0;
/// The share of the colors whose center a vertex should represent.
const NEAREST: f64 = 1e-3;
/// The number of colors that the loss is measured on.
const COLORS: usize = 40_000;
/// The number of places that a vertex can move to.
const PLACES: usize = 16;
/// The largest number of rounds, and the least gain of a round before the last.
const ROUNDS: usize = 20;
const GAIN: f64 = 1e-5;

/// A palette, and how the loss fell.
pub struct Optimized {
    /// The palette.
    pub palette: Palette,
    /// The loss of the simplified hull, and after each round.
    pub losses: Vec<f64>,
}

/// Optimizes the simplified hull of the colors.
pub fn wang(input: &WeightedColors, max_colors: usize) -> Result<Optimized, InvalidPalette> {
    let mut vertices: Vec<DVec3> =
        simplify_hull(&input.colors, max_colors)?.colors.into_iter().map(DVec3::from).collect();
    let colors = evenly(input, COLORS);
    let mut losses = vec![loss(&vertices, &colors)];
    for _ in 0..ROUNDS {
        let before = losses[losses.len() - 1];
        let mut least = before;
        for vertex in 0..vertices.len() {
            let from = vertices[vertex];
            let toward = represented(from, &colors);
            // Stays if nothing else is better.
            for place in 1..=PLACES {
                let mut moved = vertices.clone();
                moved[vertex] = from.lerp(toward, place as f64 / PLACES as f64);
                let next = loss(&moved, &colors);
                if next < least {
                    (least, vertices) = (next, moved);
                }
            }
        }
        losses.push(least);
        if before - least < GAIN {
            break;
        }
    }
    let colors = vertices.into_iter().map(|vertex| vertex.clamp(DVec3::ZERO, DVec3::ONE).into()).collect();
    Ok(Optimized { palette: input.palette(colors), losses })
}

/// Returns `lambda R + S`.
fn loss(vertices: &[DVec3], colors: &[DVec3]) -> f64 {
    let hull = Solid::new(vertices);
    // Sums of fixed parts do not depend on the number of threads.
    let sums: Vec<f64> =
        colors.par_chunks(1024).map(|part| part.iter().map(|color| hull.distance(*color)).sum()).collect();
    let reconstruction = sums.iter().sum::<f64>() / colors.len() as f64;
    let away = vertices.iter().map(|vertex| vertex.distance(represented(*vertex, colors)));
    LAMBDA * reconstruction + away.sum::<f64>() / vertices.len() as f64
}

/// Returns the center of the colors that are nearest to a vertex.
fn represented(vertex: DVec3, colors: &[DVec3]) -> DVec3 {
    let count = ((NEAREST * colors.len() as f64) as usize).clamp(1, colors.len());
    let key = |color: &DVec3| color.distance_squared(vertex);
    let mut near = colors.to_vec();
    // Colors at equal distances are ordered by their channels, so that their order in the input does not matter.
    near.select_nth_unstable_by(count - 1, |a, b| {
        key(a).total_cmp(&key(b)).then(a.x.total_cmp(&b.x)).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
    });
    near.truncate(count);
    near.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z)));
    near.iter().sum::<DVec3>() / count as f64
}

/// Chooses colors at even steps of the summed weight.
fn evenly(input: &WeightedColors, count: usize) -> Vec<DVec3> {
    let mut chosen = Vec::with_capacity(count);
    let mut sum = 0.0;
    for (color, weight) in input.colors.iter().zip(&input.weights) {
        sum += weight;
        while chosen.len() < count && (chosen.len() as f64 + 0.5) / (count as f64) < sum {
            chosen.push(DVec3::from(*color));
        }
    }
    if chosen.is_empty() { input.colors.iter().map(|&color| color.into()).collect() } else { chosen }
}

#[cfg(test)]
mod tests {
    use plenoctree::random::Random;

    use super::*;

    /// A dense ball of colors with a few outliers: every round lowers the loss, and the palette leaves the outliers.
    #[test]
    fn the_loss_falls_and_outliers_lose_their_corners() {
        let mut random = Random::new(11);
        let mut colors: Vec<[f64; 3]> =
            (0..3000).map(|_| std::array::from_fn(|_| 0.4 + 0.2 * random.fraction())).collect();
        colors.extend([[0.95, 0.5, 0.5], [0.5, 0.02, 0.5]]);
        let input = WeightedColors::new(&colors);
        let start = simplify_hull(&input.colors, 6).unwrap();
        let Optimized { palette, losses } = wang(&input, 6).unwrap();
        assert!(losses.len() > 2 && losses.windows(2).all(|pair| pair[1] <= pair[0]), "{losses:?}");
        assert!(losses[losses.len() - 1] < 0.7 * losses[0], "{losses:?}");
        let reach = |palette: &Palette| palette.colors.iter().flatten().fold(0.0f64, |far, c| far.max((c - 0.5).abs()));
        assert!(reach(&palette) < reach(&start) - 0.05, "{palette:?} {start:?}");
    }

    /// The loss of given vertices matches its definition, summed by hand.
    #[test]
    fn the_loss_is_reconstruction_and_representativeness() {
        let colors = [DVec3::ZERO, DVec3::X, DVec3::new(0.5, 0.3, 0.0), DVec3::new(1.0, 0.0, 0.4)];
        let vertices = [DVec3::ZERO, 0.9 * DVec3::X];
        let reconstruction = (0.0 + 0.1 + 0.3 + (0.01f64 + 0.16).sqrt()) / 4.0;
        let representativeness = (0.0 + 0.1) / 2.0;
        assert!((loss(&vertices, &colors) - (20.0 * reconstruction + representativeness)).abs() < 1e-12);
    }
}
