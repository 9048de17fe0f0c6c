//! Figure 5: labels in RGB and in CIELAB.

use glam::DVec3;
use image::{Rgb, RgbImage};
use plenoctree::{
    palette::ColorErrors,
    reference::{self, Posterization, cielab, filter, labels},
};
use plenoctree_cli::{hex, result::Result};

use super::{
    super::{data::Evidence, measures, methods::Method},
    rows::{COLUMNS, cells, note},
};
use crate::report::{Cell, Picture, Section, Table};

/// A color space in which the nearest label is searched.
#[derive(Clone, Copy)]
struct Space {
    name: &'static str,
    label: &'static str,
    convert: fn(DVec3) -> DVec3,
}

const SPACES: [Space; 2] = [
    Space { name: "rgb", label: "nearest label in RGB", convert: |color| color },
    Space { name: "cielab", label: "nearest label in CIELAB", convert: cielab },
];

/// A view with a label for every pixel.
struct Labeled {
    image: RgbImage,
    errors: Option<ColorErrors>,
    used: usize,
    borders: f64,
}

/// Compares hard labels found in both spaces.
pub fn section(evidence: &Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 5: labels in RGB and in CIELAB");
    section.text(
        "The same filtered pixels and the same labels (equation 7, of the paper's hull), assigned by distance in encoded \
         sRGB and in CIELAB, with hard edges; from the float64 reference. Labels used is the number of labels that \
         occur in a view; borders, the share of neighboring pixels whose labels differ, which measures detail.",
    );
    let mut rows = Vec::new();
    let mut borders_of = [0.0; 2];
    for view in 0..evidence.shots.len() {
        let mut pictures = vec![evidence.original(view)?];
        for (index, (space, labeled)) in SPACES.iter().zip(assign(evidence, view)).enumerate() {
            borders_of[index] += labeled.borders;
            let mut row = vec![Cell::Number(view as f64, 0), Cell::text(space.name)];
            row.extend(cells(labeled.errors));
            row.extend([Cell::Number(labeled.used as f64, 0), Cell::Number(100.0 * labeled.borders, 2)]);
            rows.push(row);
            let file = evidence.folder.picture(&format!("view_{view}_labels_{}", space.name), &labeled.image)?;
            let palette = Some(evidence.drawings[Method::Hull as usize].clone());
            pictures.push(Picture { file, title: space.label.into(), note: note(labeled.errors), palette });
        }
        section.pictures(pictures);
    }
    let [rgb, cielab] = borders_of.map(|sum| 100.0 * sum / evidence.shots.len() as f64);
    section.claim(
        "Labels assigned in CIELAB lose detail.",
        format!("borders between {cielab:.2}% of the neighbors with CIELAB, {rgb:.2}% with RGB"),
        cielab < rgb,
    );
    let mut head = vec![("view", "view"), ("space", "space")];
    head.extend(COLUMNS);
    head.extend([("labels used", "labels"), ("borders, %", "borders_percent")]);
    section.table(&evidence.folder, "figure_05", Table { head, rows })?;
    Ok(section)
}

/// Assigns the labels of a view in every space.
fn assign(evidence: &Evidence, view: usize) -> [Labeled; 2] {
    let shot = &evidence.shots[view];
    let settings = Posterization::default();
    let rendering = reference::render(&evidence.field, &shot.camera);
    let filtered = filter(&rendering, DVec3::ONE, &settings);
    let palette: Vec<DVec3> = evidence.methods.palette(Method::Hull).colors.iter().map(|&color| color.into()).collect();
    let labels = labels(&palette, settings.blend_steps);
    SPACES.map(|space| {
        let converted: Vec<DVec3> = labels.iter().map(|&label| (space.convert)(label)).collect();
        let nearest = |color: DVec3| {
            let color = (space.convert)(color);
            let squared = |label: &usize| color.distance_squared(converted[*label]);
            (0..converted.len()).min_by(|a, b| squared(a).total_cmp(&squared(b)))
        };
        let found: Vec<Option<usize>> = filtered
            .iter()
            .zip(&rendering.opacity)
            .map(|(&color, &opacity)| if opacity < settings.min_opacity { None } else { nearest(color) })
            .collect();
        let width = rendering.width;
        let image = RgbImage::from_fn(width as u32, rendering.height as u32, |x, y| {
            let pixel = y as usize * width + x as usize;
            let color = found[pixel].map_or(filtered[pixel], |label| labels[label]);
            Rgb(hex::quantize(color.to_array()))
        });
        let used = (0..labels.len()).filter(|label| found.contains(&Some(*label))).count();
        Labeled { errors: measures::of_picture(&shot.original, &image), image, used, borders: borders(&found, width) }
    })
}

/// Returns the share of neighboring labels that differ.
fn borders(labels: &[Option<usize>], width: usize) -> f64 {
    let (mut pairs, mut different) = (0usize, 0usize);
    for (pixel, label) in labels.iter().enumerate() {
        let right = (pixel % width + 1 < width).then_some(pixel + 1);
        let below = Some(pixel + width).filter(|below| *below < labels.len());
        for neighbor in [right, below].into_iter().flatten() {
            if let (Some(a), Some(b)) = (label, labels[neighbor]) {
                pairs += 1;
                different += usize::from(*a != b);
            }
        }
    }
    different as f64 / pairs.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::borders;

    #[test]
    fn borders_are_between_labels() {
        let labels = [Some(0), Some(0), None, Some(1), Some(0), Some(2)];
        // Four pairs of neighboring labels: 0-0 and 1-0 and 0-2 in rows, 0-1 and 0-0 in columns; one neighbor has none.
        assert_eq!(borders(&labels, 3), 3.0 / 5.0);
    }
}
