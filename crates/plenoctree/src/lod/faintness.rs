//! Measures which leaves are too faint to matter.

use std::ops::ControlFlow;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::field::PlenOctree;

/// Number of rays along each side of the box around the leaves.
const RAYS: usize = 64;
/// Number of density bins. A bin is a quarter of an octave of optical depth across a finest cell, from `2^LEAST` up.
const BINS: usize = 4 * 32;
const LEAST: f64 = -24.0;
/// Number of rays along each side of the patches that [`lost`] looks at: an eighth of the side of the box.
#[cfg(feature = "write")]
const PATCH: usize = RAYS / 8;
/// Transmittance below which a ray stops.
const STOP: f64 = 0.01;

/// The opacity that rays lose if faint leaves are removed, measured in both directions along every axis.
pub struct Faintness {
    /// Width of a finest cell, in world units.
    width: f64,
    /// For every bin, the opacity that leaves up to that bin add to a ray: the root mean square over rays that hit a
    /// leaf.
    lost: [f64; BINS],
}

impl Faintness {
    /// Measures a field by marching rays through all of it, on all cores.
    pub fn measure(field: &PlenOctree) -> Self {
        let width = (field.frame().scale * f64::from(1u32 << field.depth())).element_product().cbrt().recip();
        let mut lost = [0.0; BINS];
        let bin = |leaf: u32| {
            let density = f64::from(field.densities()[leaf as usize]);
            (4.0 * ((density * width).log2() - LEAST)).clamp(0.0, (BINS - 1) as f64) as usize
        };
        let rays = (0..6 * RAYS * RAYS).into_par_iter().filter_map(|ray| {
            let (side, at) = (ray / (RAYS * RAYS), ray % (RAYS * RAYS));
            opacity_by_bin(field, [side, at % RAYS, at / RAYS], bin)
        });
        let (sums, count) = rays.map(|ray| (ray, 1usize)).reduce(
            || ([0.0; BINS], 0),
            |(mut a, count), (b, more)| {
                a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                (a, count + more)
            },
        );
        for (lost, sum) in lost.iter_mut().zip(sums) {
            // NaN if no ray meets a leaf: then it is not known that any is faint.
            *lost = (sum / count as f64).sqrt();
        }
        Self { width, lost }
    }

    /// Returns the density, per world unit, below which leaves can be removed at a loss of at most `loss` of the rays'
    /// opacity (0 to 1, root mean square). Returns 0 if no leaf can be removed.
    ///
    /// Pass it to [`PlenOctree::thinned`].
    pub fn threshold(&self, loss: f32) -> f32 {
        let bins = self.lost.iter().take_while(|lost| **lost <= f64::from(loss)).count();
        if bins == 0 { 0.0 } else { ((bins as f64 / 4.0 + LEAST).exp2() / self.width) as f32 }
    }
}

/// Returns the opacity that rays lose if the leaves up to each of `N` bins are removed: the root mean square over rays
/// side by side, where it is largest.
#[cfg(feature = "write")]
pub(crate) fn lost<const N: usize>(field: &PlenOctree, bin: impl Fn(u32) -> usize + Sync) -> [f64; N] {
    let patches = RAYS / PATCH;
    let patch = |patch: usize| {
        let [side, x, y] = [patch / (patches * patches), patch % patches, patch / patches % patches];
        let mut sums = [0.0; N];
        for ray in 0..PATCH * PATCH {
            let at = [side, x * PATCH + ray % PATCH, y * PATCH + ray / PATCH];
            let squares = opacity_by_bin(field, at, &bin).unwrap_or([0.0; N]);
            sums.iter_mut().zip(squares).for_each(|(sum, square)| *sum += square);
        }
        sums.map(|sum| (sum / (PATCH * PATCH) as f64).sqrt())
    };
    let all = (0..6 * patches * patches).into_par_iter().map(patch);
    all.reduce(|| [0.0; N], |a, b| std::array::from_fn(|bin| a[bin].max(b[bin])))
}

/// Returns the squared opacity that leaves up to each of `N` bins add to a ray, or `None` if the ray hits no leaf. The
/// ray starts at the side of the box around the leaves, 0 to 5, and at the place in it, and is parallel to an axis.
fn opacity_by_bin<const N: usize>(
    field: &PlenOctree,
    [side, x, y]: [usize; 3],
    bin: impl Fn(u32) -> usize,
) -> Option<[f64; N]> {
    let (low, high) = field.bounds()?;
    let (axis, backward) = (side % 3, side >= 3);
    let mut place = DVec3::ZERO;
    (place[(axis + 1) % 3], place[(axis + 2) % 3]) = ((DVec2::new(x as f64, y as f64) + 0.5) / RAYS as f64).into();
    // A little outside the box, because rays start at their origin.
    place[axis] = if backward { 1.01 } else { -0.01 };
    let mut direction = DVec3::ZERO;
    direction[axis] = if backward { -1.0 } else { 1.0 };
    let mut added = [0.0; N];
    let (mut transmittance, mut met) = (1.0f64, false);
    field.march(low + place * (high - low), direction, |crossing| {
        met = true;
        let density = f64::from(field.densities()[crossing.leaf as usize]);
        let opacity = -(-density * crossing.length).exp_m1();
        added[bin(crossing.leaf)] += transmittance * opacity;
        transmittance *= 1.0 - opacity;
        if transmittance < STOP { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let mut sum = 0.0;
    met.then(|| {
        added.map(|added| {
            sum += added;
            sum * sum
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::{Basis, Cell, Frame, UpAxis},
    };

    fn ball(density: impl Fn(f64) -> f64 + Sync) -> PlenOctree {
        let settings =
            BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, min_density: 0.0, ..Default::default() };
        bake(&settings, |at| density(at.length()), |_| |_| DVec3::splat(0.5)).unwrap()
    }

    #[test]
    fn haze_around_a_ball_is_removed() {
        let field = ball(|radius| if radius < 0.6 { 300.0 } else { 0.001 });
        let faintness = Faintness::measure(&field);
        let threshold = faintness.threshold(0.005);
        assert!((0.002..200.0).contains(&threshold), "{threshold}");
        assert_eq!(field.thinned(faintness.threshold(1e-3)).leaves(), field.leaves());
    }

    /// Every leaf is faint, but together they are all that is visible. Only leaves at the edge of the fog may go.
    #[test]
    fn uniform_fog_is_kept() {
        let field = ball(|radius| if radius < 0.9 { 0.5 } else { 0.0 });
        let thinned = field.thinned(Faintness::measure(&field).threshold(0.05));
        assert!(thinned.leaves() as f64 > 0.9 * field.leaves() as f64);
        assert!(thinned.densities().iter().all(|density| *density > 0.2));
    }

    /// Nothing is known to be faint if no ray meets it.
    #[test]
    fn tiny_parts_far_apart_are_kept() {
        // A leaf in each of two opposite corners, at depth 9.
        let chain = |corner: usize, leaf: u32, first: u32| {
            (1..9u32).map(move |level| {
                let mut node = [Cell::EMPTY; 8];
                node[corner] = if level == 8 { Cell::leaf(leaf) } else { Cell::node(first + level) };
                node
            })
        };
        let mut root = [Cell::EMPTY; 8];
        (root[0], root[7]) = (Cell::node(1), Cell::node(9));
        let nodes: Vec<_> = [root].into_iter().chain(chain(0, 0, 1)).chain(chain(7, 1, 9)).collect();
        let frame = Frame::spanning(DVec3::NEG_ONE, DVec3::ONE);
        let (basis, coefficients) = (Basis::Rgba, vec![half::f16::ONE; 6]);
        let field =
            PlenOctree::new(frame, basis, basis.default_activation(), UpAxis::Y, nodes, vec![100.0; 2], coefficients);
        let field = field.unwrap();
        for loss in [1e-3, 0.05, 1.0] {
            assert_eq!(field.thinned(Faintness::measure(&field).threshold(loss)).leaves(), 2, "{loss}");
        }
    }
}
