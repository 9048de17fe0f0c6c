//! Counts which tones are seen beside each other.

use glam::DVec3;
use rayon::prelude::*;

use crate::{
    palette::{
        colors::Palette,
        space::{nearest, tone_space},
    },
    sampling::{View, ViewRays},
};

/// How often colors of a palette are seen beside each other: symmetric, with zeros on the diagonal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Borders {
    colors: usize,
    counts: Vec<u32>,
}

/// The largest difference of depth of neighboring rays that hit the same surface, as a multiple of their distance.
const STEEP: f64 = 3.0;

impl Borders {
    /// Returns no borders at all.
    pub fn none(colors: usize) -> Self {
        Self { colors, counts: vec![0; colors * colors] }
    }

    /// Counts the borders in views of the field from all directions from which it is sampled. Colors are beside each
    /// other where neighboring rays see them at nearly the same depth, so that occlusion makes no border.
    pub fn of(views: &[View], palette: &Palette) -> Self {
        let tones: Vec<DVec3> = palette.colors.iter().map(|color| tone_space((*color).into())).collect();
        let add = |a: Self, b: Self| {
            let counts = a.counts.iter().zip(&b.counts).map(|(a, b)| a + b).collect();
            Self { counts, ..a }
        };
        views.par_iter().map(|view| Self::in_view(view, &tones)).reduce(|| Self::none(tones.len()), add)
    }

    fn in_view(view: &View, tones: &[DVec3]) -> Self {
        let mut borders = Self::none(tones.len());
        let tone = |color: DVec3| nearest(tone_space(color), tones.iter().copied()).0;
        // The tone and the depth of the rays above and to the left.
        let (mut above, mut left): (Vec<Option<(usize, f64)>>, _) = (vec![None; ViewRays::SIDE], None);
        for (ray, seen) in view.seen.iter().enumerate() {
            let column = ray % ViewRays::SIDE;
            let seen = seen.map(|seen| (tone(seen.color()), f64::from(seen.depth)));
            let before = if column == 0 { None } else { left };
            for (other, depth) in [before, above[column]].into_iter().flatten() {
                if let Some((own, own_depth)) = seen
                    && (own_depth - depth).abs() <= STEEP * view.step
                {
                    borders.add(own, other);
                }
            }
            (left, above[column]) = (seen, seen);
        }
        borders
    }

    /// Returns how often two colors are seen beside each other.
    pub fn between(&self, a: usize, b: usize) -> u32 {
        self.counts[a * self.colors + b]
    }

    fn add(&mut self, a: usize, b: usize) {
        if a != b {
            self.counts[a * self.colors + b] += 1;
            self.counts[b * self.colors + a] += 1;
        }
    }
}
