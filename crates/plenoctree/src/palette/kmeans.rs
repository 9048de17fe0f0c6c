//! Weighted k-means (Lloyd's algorithm): section 3 of the method, step 7.
//!
//! The stopping rule, and the treatment of centers that lose all their points, are those of scikit-learn's
//! `KMeans(init=centers, n_init=1, algorithm="elkan")`. Points and initial centers are on lattices, so many points are
//! equally far from two centers. Ties go to the lowest index. Points are not centered on their mean first, because this
//! would make the distances inexact.

use rayon::prelude::*;

use super::space;
use crate::sampling::{Canceled, Progress};

type Point = [f64; 3];

/// Cluster centers, and the weight of the points that are nearest to each.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Clusters {
    pub centers: Vec<Point>,
    pub weights: Vec<f64>,
}

/// Clusters `points`, starting from `centers`. There must be at least one point and one center, and all weights must be
/// positive.
pub(super) fn cluster(
    points: &[Point],
    weights: &[f64],
    mut centers: Vec<Point>,
    max_iterations: usize,
    tolerance: f64,
    progress: &Progress,
) -> Result<Clusters, Canceled> {
    let tolerance = tolerance * mean_variance(points);
    let mut labels = vec![usize::MAX; points.len()];
    for _ in 0..max_iterations {
        let changed = assign(points, &centers, &mut labels, progress)?;
        let moved = update(points, weights, &labels, &centers);
        let shift: f64 = centers.iter().zip(&moved).map(|(a, b)| distance_squared(a, b)).sum();
        centers = moved;
        if !changed || shift <= tolerance {
            break;
        }
    }
    assign(points, &centers, &mut labels, progress)?;
    let mut in_cluster = vec![0.0; centers.len()];
    labels.iter().zip(weights).for_each(|(&label, weight)| in_cluster[label] += weight);
    Ok(Clusters { centers, weights: in_cluster })
}

/// Assigns every point to the nearest center. Returns whether an assignment changed.
fn assign(points: &[Point], centers: &[Point], labels: &mut [usize], progress: &Progress) -> Result<bool, Canceled> {
    let search = Search::new(centers);
    let assign = |(point, label): (&Point, &mut usize)| {
        progress.check()?;
        let nearest = search.nearest(point, *label);
        Ok(std::mem::replace(label, nearest) != nearest)
    };
    points.par_iter().zip(labels).with_min_len(1024).map(assign).try_reduce(|| false, |a, b| Ok(a | b))
}

/// Centers in the order of the axis along which they are spread the most, so that most of them need not be visited.
struct Search<'a> {
    centers: &'a [Point],
    axis: usize,
    /// Coordinate along the axis, and index, of every center.
    sorted: Vec<(f64, usize)>,
}

impl<'a> Search<'a> {
    fn new(centers: &'a [Point]) -> Self {
        let spread = |axis: usize| {
            let along = centers.iter().map(|center| center[axis]);
            along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
        };
        let axis = (1..3).fold(0, |best, axis| if spread(axis) > spread(best) { axis } else { best });
        let mut sorted: Vec<_> = centers.iter().map(|center| center[axis]).zip(0..).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self { centers, axis, sorted }
    }

    /// Returns what [`nearest`] returns. `guess` is a center that may be near, or no center.
    fn nearest(&self, point: &Point, guess: usize) -> usize {
        let mut best = match self.centers.get(guess) {
            Some(center) => (distance_squared(point, center), guess),
            None => (f64::INFINITY, usize::MAX),
        };
        // Rounding is monotonic, so the computed distance of a center is never less than that along one axis. Returns
        // whether centers that are farther along the axis can be nearer.
        let mut visit = |&(along, index): &(f64, usize)| {
            let off = point[self.axis] - along;
            if off * off > best.0 {
                return false;
            }
            let distance = distance_squared(point, &self.centers[index]);
            if distance < best.0 || distance == best.0 && index < best.1 {
                best = (distance, index);
            }
            true
        };
        let (before, after) = self.sorted.split_at(self.sorted.partition_point(|&(along, _)| along < point[self.axis]));
        after.iter().take_while(|center| visit(center)).for_each(drop);
        before.iter().rev().take_while(|center| visit(center)).for_each(drop);
        best.1
    }
}

/// Returns the index of the center nearest to `point`. Ties go to the lowest index.
pub(super) fn nearest(point: &Point, centers: &[Point]) -> usize {
    space::nearest((*point).into(), centers.iter().map(|center| (*center).into())).0
}

/// Returns the weighted mean of every cluster.
///
/// Each center without points moves to one of the points that are farthest from their own centers. If every point
/// coincides with its center, it moves to the heaviest cluster instead. A center whose points have no weight left, but
/// for rounding, keeps its place.
fn update(points: &[Point], weights: &[f64], labels: &[usize], centers: &[Point]) -> Vec<Point> {
    let mut sums = vec![[0.0; 3]; centers.len()];
    let mut in_cluster = vec![0.0; centers.len()];
    let mut counts = vec![0usize; centers.len()];
    for ((point, &weight), &label) in points.iter().zip(weights).zip(labels) {
        add(&mut sums[label], point, weight);
        in_cluster[label] += weight;
        counts[label] += 1;
    }
    let empty: Vec<usize> = (0..centers.len()).filter(|&center| counts[center] == 0).collect();
    if !empty.is_empty() {
        let mut far: Vec<(f64, usize)> = points
            .iter()
            .zip(labels)
            .map(|(point, &label)| distance_squared(point, &centers[label]))
            .zip(0..)
            .collect();
        let farthest_first = |a: &(f64, usize), b: &(f64, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
        if empty.len() < far.len() {
            far.select_nth_unstable_by(empty.len(), farthest_first);
            far.truncate(empty.len());
        }
        far.sort_unstable_by(farthest_first);
        if far[0].0 > 0.0 {
            for (&center, &(_, point)) in empty.iter().zip(&far) {
                let (label, weight) = (labels[point], weights[point]);
                add(&mut sums[label], &points[point], -weight);
                in_cluster[label] -= weight;
                counts[label] -= 1;
                add(&mut sums[center], &points[point], weight);
                in_cluster[center] = weight;
                counts[center] = 1;
            }
        }
    }
    let heaviest = (0..centers.len()).fold(0, |best, i| if in_cluster[i] > in_cluster[best] { i } else { best });
    (0..centers.len())
        .map(|center| {
            let source = if counts[center] > 0 { center } else { heaviest };
            let weight = in_cluster[source];
            if weight > 0.0 { sums[source].map(|sum| sum / weight) } else { centers[center] }
        })
        .collect()
}

fn add(sum: &mut Point, point: &Point, weight: f64) {
    sum.iter_mut().zip(point).for_each(|(sum, x)| *sum += x * weight);
}

fn distance_squared(a: &Point, b: &Point) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    x * x + y * y + z * z
}

/// Returns the variance of the points, ignoring their weights, averaged over the axes.
fn mean_variance(points: &[Point]) -> f64 {
    let count = points.len() as f64;
    (0..3)
        .map(|axis| {
            let mean = points.iter().map(|p| p[axis]).sum::<f64>() / count;
            points.iter().map(|p| (p[axis] - mean).powi(2)).sum::<f64>() / count
        })
        .sum::<f64>()
        / 3.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn cluster(points: &[Point], weights: &[f64], centers: Vec<Point>, iterations: usize, tolerance: f64) -> Clusters {
        super::cluster(points, weights, centers, iterations, tolerance, &Progress::default()).unwrap()
    }

    /// Points that are equally far from two centers go to the first, and means are weighted.
    #[test]
    fn ties_go_to_the_lowest_index() {
        let points = [[0.25, 0.0, 0.0], [0.5, 0.0, 0.0], [0.75, 0.0, 0.0]];
        let clusters = cluster(&points, &[1.0, 3.0, 2.0], vec![[0.25, 0.0, 0.0], [0.75, 0.0, 0.0]], 1, 0.0);
        assert_eq!(clusters.centers, [[0.4375, 0.0, 0.0], [0.75, 0.0, 0.0]]);
        assert_eq!(clusters.weights, [4.0, 2.0]);
    }

    /// A center that is nearest to no point moves to the point that is farthest from its own center.
    #[test]
    fn a_lost_center_takes_the_farthest_point() {
        let points = [[0.0; 3], [0.1, 0.0, 0.0], [1.0, 0.0, 0.0]];
        let clusters = cluster(&points, &[1.0, 1.0, 1.0], vec![[0.0; 3], [0.0, 9.0, 0.0]], 300, 1e-4);
        assert_eq!(clusters.centers, [[0.05, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        assert_eq!(clusters.weights, [2.0, 1.0]);
    }

    #[test]
    fn more_centers_than_points_end_on_points() {
        let clusters = cluster(&[[0.5; 3]], &[2.0], vec![[0.1; 3], [0.9; 3], [0.4; 3]], 300, 1e-4);
        assert!(clusters.centers.iter().all(|center| *center == [0.5; 3]));
        assert_eq!(clusters.weights, [2.0, 0.0, 0.0]);
    }

    /// Points and centers on one lattice, where many distances tie, or anywhere.
    fn colors(count: usize) -> impl Strategy<Value = Vec<Point>> {
        let lattice = prop::array::uniform3(0..8u8).prop_map(|p| p.map(|x| (f64::from(x) + 0.5) / 8.0));
        let anywhere = prop::array::uniform3(0.0..1.0f64);
        prop_oneof![prop::collection::vec(lattice, 1..count), prop::collection::vec(anywhere, 1..count)]
    }

    proptest! {
        /// Skipping centers changes nothing, for any guess.
        #[test]
        fn the_search_finds_the_first_of_the_nearest(points in colors(50), centers in colors(100), guess in 0usize..120) {
            let search = Search::new(&centers);
            for point in &points {
                prop_assert_eq!(search.nearest(point, guess), nearest(point, &centers));
            }
        }

        /// When the algorithm has converged, every center is the weighted mean of the points nearest to it: Lloyd's
        /// fixed point.
        #[test]
        fn centers_are_means_of_their_points(
            points in prop::collection::vec((prop::array::uniform3(0.0..1.0f64), 0.01..10.0f64), 8..200),
            count in 1usize..8,
        ) {
            let (points, weights): (Vec<_>, Vec<_>) = points.into_iter().unzip();
            let clusters = cluster(&points, &weights, points[..count].to_vec(), 100_000, 0.0);
            let mut labels = vec![0; points.len()];
            assign(&points, &clusters.centers, &mut labels, &Progress::default()).unwrap();
            let means = update(&points, &weights, &labels, &clusters.centers);
            for (center, mean) in clusters.centers.iter().zip(&means) {
                prop_assert!(distance_squared(center, mean) < 1e-20);
            }
            prop_assert!((clusters.weights.iter().sum::<f64>() / weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
