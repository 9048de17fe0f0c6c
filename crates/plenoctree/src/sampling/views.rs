//! What parallel rays see of a field from all directions from which it is sampled.

use std::ops::ControlFlow;

use glam::DVec3;
use rayon::prelude::*;

use super::{
    directions::observers,
    progress::{Canceled, Progress},
};
use crate::{
    field::{LABEL_OPACITY, PlenOctree},
    histograms::SamplingSettings,
};

/// The most cells of directions from the horizon to the top: 256 views of a hemisphere.
const MOST_DIRECTIONS: usize = 8;

/// Parallel rays into a field, on a square grid of [`SIDE`](Self::SIDE) x `SIDE`, in the field's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewRays {
    /// The origin of the first ray, outside of most of the field.
    pub first: DVec3,
    /// The step from each ray to the next one of its row.
    pub right: DVec3,
    /// The step from each row to the next one.
    pub down: DVec3,
    /// The direction of all rays, a unit vector.
    pub direction: DVec3,
}

impl ViewRays {
    /// Number of rays along each side.
    pub const SIDE: usize = 96;

    /// Returns the rays from every direction from which the settings sample a field, or none if it is empty. More than
    /// eight cells of directions count as eight, because more views take gigabytes and show little more.
    pub fn all(field: &PlenOctree, settings: &SamplingSettings) -> Vec<Self> {
        let Some((low, high)) = field.dense_bounds() else { return Vec::new() };
        let (center, radius) = (0.5 * (low + high), 0.5 * low.distance(high));
        let step = 2.0 * radius / Self::SIDE as f64;
        let directions = settings.directions.min(MOST_DIRECTIONS);
        let settings = SamplingSettings { directions, multisamples: 1, ..settings.clone() };
        let rays = |observer: DVec3| {
            let (right, down) = observer.any_orthonormal_pair();
            let (right, down) = (step * right, step * down);
            let first = center + radius * observer + (0.5 - 0.5 * Self::SIDE as f64) * (right + down);
            Self { first, right, down, direction: -observer }
        };
        observers(field.up(), &settings).into_iter().flatten().map(rays).collect()
    }
}

/// What [rays](ViewRays) see of a field.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The distance of neighboring rays.
    pub(crate) step: f64,
    /// What the rays see, row by row, or `None` where what a ray sees is too faint to get a label.
    pub(crate) seen: Vec<Option<Seen>>,
}

/// What a ray sees. With 32 bits, because there are many.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    color: [f32; 3],
    /// The depth at which the ray enters the leaf in which it becomes half opaque, or infinity if it does not.
    pub depth: f32,
}

impl Seen {
    /// Returns what a ray sees, given its opacity and the depth at which it becomes half opaque, unless it is too faint.
    fn new(color: [f32; 3], opacity: f32, surface: Option<f32>) -> Option<Self> {
        (surface.is_some() || opacity >= LABEL_OPACITY as f32)
            .then_some(Self { color, depth: surface.unwrap_or(f32::INFINITY) })
    }

    /// Returns the color in encoded sRGB.
    pub fn color(&self) -> DVec3 {
        DVec3::from(self.color.map(f64::from))
    }
}

/// The share of views in the time that a palette of tones takes after sampling.
const SHARE: f32 = 0.3;
/// Transmittance below which a ray ends.
const OPAQUE: f64 = 1e-2;
/// Opacity from which a ray sees a surface.
const SURFACE: f64 = 0.5;

impl View {
    /// Returns what all rays see of a field, on all cores.
    ///
    /// # Errors
    ///
    /// Returns an error if [`Progress::cancel`] is called.
    pub fn all(field: &PlenOctree, rays: &[ViewRays], progress: &Progress) -> Result<Vec<Self>, Canceled> {
        let view = |view: &ViewRays| {
            let basis = field.basis().evaluate(view.direction);
            let mut seen = Vec::with_capacity(ViewRays::SIDE * ViewRays::SIDE);
            for row in 0..ViewRays::SIDE {
                progress.check()?;
                for column in 0..ViewRays::SIDE {
                    let origin = view.first + (row as f64 * view.down + column as f64 * view.right);
                    seen.push(see(field, origin, view.direction, &basis));
                }
            }
            progress.compute(SHARE / rays.len() as f32);
            Ok(Self { step: view.right.length(), seen })
        };
        rays.par_iter().map(view).collect()
    }

    /// Returns what all rays see according to another program, such as one on the GPU: `texels` holds their colors in
    /// encoded sRGB, each with the depth at which the ray enters the leaf in which it becomes half opaque or, where it does
    /// not, its opacity times -1.
    ///
    /// Rays end where less than 1% of the light is left, and their colors are divided by their opacity.
    pub fn from_texels(rays: &[ViewRays], texels: &[[f32; 4]], progress: &Progress) -> Vec<Self> {
        let seen = |&[r, g, b, depth]: &[f32; 4]| Seen::new([r, g, b], -depth, (depth > 0.0).then_some(depth));
        let view = |(view, texels): (&ViewRays, &[[f32; 4]])| {
            progress.compute(SHARE / rays.len() as f32);
            Self { step: view.right.length(), seen: texels.iter().map(seen).collect() }
        };
        rays.iter().zip(texels.chunks_exact(ViewRays::SIDE * ViewRays::SIDE)).map(view).collect()
    }

    /// Returns the colors that rays see, in encoded sRGB, and whether each becomes half opaque, as at a surface.
    pub(crate) fn colors(&self) -> impl Iterator<Item = (DVec3, bool)> {
        self.seen.iter().flatten().map(|seen| (seen.color(), seen.depth.is_finite()))
    }
}

fn see(field: &PlenOctree, origin: DVec3, direction: DVec3, basis: &[f64; 25]) -> Option<Seen> {
    let (mut color, mut transmittance, mut depth) = (DVec3::ZERO, 1.0, None);
    field.march(origin, direction, |crossing| {
        let opacity = -(-f64::from(field.densities()[crossing.leaf as usize]) * crossing.length).exp_m1();
        color += transmittance * opacity * field.radiance_with(crossing.leaf, basis);
        transmittance *= 1.0 - opacity;
        if depth.is_none() && transmittance < 1.0 - SURFACE {
            depth = Some(crossing.start as f32);
        }
        if transmittance < OPAQUE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let opacity = 1.0 - transmittance;
    Seen::new((color / opacity).as_vec3().to_array(), opacity as f32, depth)
}

#[cfg(test)]
mod tests {
    use half::f16;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::{Activation, Basis, Cell, Frame, UpAxis},
    };

    /// Rays that are not half opaque have a color from an opacity of 80/255 on, and no depth.
    #[test]
    fn faint_rays_have_no_depth() {
        let [first, right, down, direction] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let rays = [ViewRays { first, right, down, direction }];
        let mut texels = vec![[0.5, 0.5, 0.5, 0.0]; ViewRays::SIDE * ViewRays::SIDE];
        for (texel, depth) in texels.iter_mut().zip([2.0, -0.49, -0.32, -0.31]) {
            texel[3] = depth;
        }
        let views = View::from_texels(&rays, &texels, &Progress::default());
        let depths: Vec<_> = views[0].seen[..5].iter().map(|seen| seen.map(|seen| seen.depth)).collect();
        assert_eq!(depths, [Some(2.0), Some(f32::INFINITY), Some(f32::INFINITY), None, None]);
    }

    /// A large leaf is seen like the small ones that it stands for.
    #[test]
    fn large_leaves_are_in_view() {
        // A full cube of leaves that are red and 1/32 wide, and far from it one that is blue and half as wide as all.
        let mut nodes = vec![std::array::from_fn(|cell| match cell {
            0 => Cell::node(1),
            7 => Cell::leaf(0),
            _ => Cell::EMPTY,
        })];
        nodes.push(std::array::from_fn(|cell| if cell == 0 { Cell::node(2) } else { Cell::EMPTY }));
        let mut leaves = 1;
        for (level, first) in [(2, 2), (3, 3), (4, 11)] {
            for node in 0..8u32.pow(level - 2) {
                nodes.push(std::array::from_fn(|cell| {
                    leaves += u32::from(level == 4);
                    let child = first + 8u32.pow(level - 2) + 8 * node + cell as u32;
                    if level == 4 { Cell::leaf(leaves - 1) } else { Cell::node(child) }
                }));
            }
        }
        let color = |leaf: u32| if leaf == 0 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
        let coefficients = (0..leaves).flat_map(color).map(f16::from_f32).collect();
        let (frame, density) = (Frame::spanning(DVec3::ZERO, DVec3::ONE), vec![1e3; leaves as usize]);
        let (basis, activation) = (Basis::Rgba, Activation::Identity);
        let field = PlenOctree::new(frame, basis, activation, UpAxis::Z, nodes, density, coefficients).unwrap();
        let rays = ViewRays::all(&field, &SamplingSettings::default());
        let views = View::all(&field, &rays, &Progress::default()).unwrap();
        let blue = views.iter().flat_map(View::colors).filter(|(color, _)| color.z > 0.9).count();
        assert!(blue > 1000, "{blue} rays see the large leaf");
    }

    /// However many directions a field is sampled from, its views fit in memory.
    #[test]
    fn there_are_few_views() {
        let settings = BakeSettings { depth: 1, ..Default::default() };
        let field = bake(&settings, |_| 1.0, |_| |_| DVec3::ONE).unwrap();
        let count = |directions| ViewRays::all(&field, &SamplingSettings { directions, ..Default::default() }).len();
        assert_eq!([1, 2, 8, 9, 32].map(count), [4, 16, 256, 256, 256]);
    }
}
