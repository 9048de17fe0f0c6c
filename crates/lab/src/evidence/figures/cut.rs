//! Figure 3: a cut through the field.

use std::collections::HashSet;

use glam::DVec3;
use image::{Rgb, RgbImage};
use plenoctree::PlenOctree;
use plenoctree_cli::{hex, result::Result};
use rayon::prelude::*;

use super::super::{
    baselines::{RawSample, transmittance},
    data::Evidence,
};
use crate::report::{Cell, Picture, Section, Table};

/// The width and height of the cut, in pixels.
const SIDE: usize = 320;
/// The decades of visibility that differ in color.
const DECADES: f64 = 3.0;
/// The transmittance below which a leaf counts as hidden, as in extraction.
const STOP: f64 = 1e-2;
/// The colors of visibility, from the lowest to the highest.
const RAMP: [[f64; 3]; 4] = [[0.27, 0.0, 0.33], [0.19, 0.41, 0.56], [0.21, 0.72, 0.47], [0.99, 0.91, 0.14]];
/// The color of hidden leaves.
const HIDDEN: Rgb<u8> = Rgb([30, 30, 34]);
/// The color of empty cells.
const EMPTY: Rgb<u8> = Rgb([255; 3]);

/// A point of the cut.
#[derive(Clone, Copy)]
struct Point {
    color: DVec3,
    visibility: f64,
}

/// A plane through the middle of a field, and the direction from which it is seen.
struct Plane {
    center: DVec3,
    right: DVec3,
    up: DVec3,
    radius: f64,
    observer: DVec3,
}

/// Shows radiance next to visibility.
pub fn section(evidence: &Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 3: radiance and volumetric visibility");
    section.text(
        "A vertical cut through the middle of the field, seen by a distant observer at the upper right, in the \
         direction of view 0. Left, the radiance of every leaf toward the observer, seen or not; then the volumetric \
         visibility (equation 8), from violet to yellow over three decades, dark where the transmittance is below \
         0.01; then the radiance of what is seen.",
    );
    let plane = Plane::through(&evidence.field, evidence.shots[0].camera.position).ok_or("the field is empty")?;
    let field = &evidence.field;
    let points: Vec<Option<Point>> = (0..SIDE * SIDE)
        .into_par_iter()
        .map(|pixel| sample(field, plane.point(pixel % SIDE, pixel / SIDE), plane.observer))
        .collect();
    let most = points.iter().flatten().map(|point| point.visibility).fold(f64::MIN_POSITIVE, f64::max);
    let draw = |ink: &dyn Fn(Point) -> Rgb<u8>| {
        RgbImage::from_fn(SIDE as u32, SIDE as u32, |x, y| points[y as usize * SIDE + x as usize].map_or(EMPTY, ink))
    };
    let radiance = |point: Point| Rgb(hex::quantize(point.color.to_array()));
    let pictures: [(&str, &str, &dyn Fn(Point) -> Rgb<u8>); 3] = [
        ("cut_radiance", "radiance", &radiance),
        ("cut_visibility", "visibility", &|point| heat(point.visibility / most)),
        ("cut_seen", "radiance of what is seen", &|point| {
            if point.visibility > 0.0 { radiance(point) } else { HIDDEN }
        }),
    ];
    let mut row = Vec::new();
    for (name, title, ink) in pictures {
        let file = evidence.folder.picture(name, &draw(ink))?;
        row.push(Picture { file, title: title.into(), note: String::new(), palette: None });
    }
    section.pictures(row);
    noise(evidence, &mut section)?;
    Ok(section)
}

/// Statistics of visible or of hidden samples.
struct Samples {
    share: f64,
    roughness: f64,
    foreign: f64,
}

/// Reports how noisy the colors of hidden samples are.
fn noise(evidence: &Evidence, section: &mut Section) -> Result {
    section.text(
        "Of the raw radiance samples that other methods get, this share is hidden. Roughness is the root of the mean \
         squared difference of a channel between neighboring leaves, seen in the same direction. Foreign colors are \
         those that share no cell of 16 x 16 x 16 with any sample that is seen.",
    );
    let all = &evidence.methods.raw.some;
    let cell = |color: &[f64; 3]| color.map(|channel| (channel.clamp(0.0, 0.999) * 16.0) as usize);
    let seen_cells: HashSet<_> = all.iter().filter(|sample| sample.seen).map(|sample| cell(&sample.color)).collect();
    let samples = [true, false].map(|seen| {
        let samples: Vec<&RawSample> = all.iter().filter(|sample| sample.seen == seen).collect();
        let pairs = samples.iter().filter_map(|sample| Some((sample.color, sample.neighbor?)));
        let squares = pairs.map(|(a, b)| DVec3::from(a).distance_squared(b.into()) / 3.0);
        let (sum, count) = squares.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0));
        let foreign = samples.iter().filter(|sample| !seen_cells.contains(&cell(&sample.color))).count();
        (!samples.is_empty()).then(|| Samples {
            share: samples.len() as f64 / all.len() as f64,
            roughness: f64::sqrt(sum / f64::max(count, 1.0)),
            foreign: foreign as f64 / samples.len() as f64,
        })
    });
    if let [Some(seen), Some(hidden)] = &samples {
        section.claim(
            "Hidden radiance is noisy.",
            format!(
                "roughness {:.3} where hidden, {:.3} where seen; {:.1}% of the hidden colors are foreign",
                hidden.roughness,
                seen.roughness,
                100.0 * hidden.foreign
            ),
            hidden.roughness > seen.roughness,
        );
    }
    let rows = ["seen", "hidden"].iter().zip(&samples).map(|(name, samples)| {
        let cell = |of: fn(&Samples) -> f64, digits| Cell::number(samples.as_ref().map(of), digits);
        let measured = [cell(|s| 100.0 * s.share, 1), cell(|s| s.roughness, 3), cell(|s| 100.0 * s.foreign, 1)];
        [vec![Cell::text(*name)], measured.into()].concat()
    });
    let head = vec![
        ("samples", "samples"),
        ("share, %", "share_percent"),
        ("roughness", "roughness"),
        ("foreign colors, %", "foreign_percent"),
    ];
    section.table(&evidence.folder, "figure_03", Table { head, rows: rows.collect() })
}

impl Plane {
    /// Returns the vertical plane through the middle of a field that contains the direction to an observer, or `None`
    /// if the field is empty.
    fn through(field: &PlenOctree, observer: DVec3) -> Option<Self> {
        let (low, high) = field.dense_bounds()?;
        let center = 0.5 * (low + high);
        let to_field = field.up().to_y_up().transpose();
        let (up, front) = (to_field * DVec3::Y, to_field * DVec3::Z);
        let observer = (observer - center).try_normalize().unwrap_or(up);
        let right = observer.reject_from_normalized(up).try_normalize().unwrap_or(front);
        let half = 0.5 * (high - low);
        let radius = 1.05 * half.dot(right.abs()).max(half.dot(up.abs()));
        Some(Self { center, right, up, radius, observer })
    }

    /// Returns the point at the center of a pixel.
    fn point(&self, x: usize, y: usize) -> DVec3 {
        let [x, y] = [x, y].map(|pixel| self.radius * (2.0 * (pixel as f64 + 0.5) / SIDE as f64 - 1.0));
        self.center + x * self.right - y * self.up
    }
}

/// Returns the radiance and the visibility at a point, or `None` if it is empty.
fn sample(field: &PlenOctree, point: DVec3, observer: DVec3) -> Option<Point> {
    let cells = f64::from(1u32 << field.depth());
    let position = (field.frame().to_tree(point) * cells).floor();
    let inside = position.cmpge(DVec3::ZERO).all() && position.cmplt(DVec3::splat(cells)).all();
    let leaf = inside.then(|| field.locate(position.as_uvec3()).0.as_leaf()).flatten()?;
    let through = transmittance(field, point, observer);
    let density = f64::from(field.densities()[leaf as usize]);
    let visibility = if through < STOP { 0.0 } else { density * through };
    Some(Point { color: field.radiance(leaf, -observer), visibility })
}

/// Returns the color of a share of the highest visibility.
fn heat(share: f64) -> Rgb<u8> {
    if share <= 0.0 {
        return HIDDEN;
    }
    let place = (1.0 + share.log10() / DECADES).clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let index = (place as usize).min(RAMP.len() - 2);
    let color = DVec3::from(RAMP[index]).lerp(RAMP[index + 1].into(), place - index as f64);
    Rgb(hex::quantize(color.to_array()))
}
