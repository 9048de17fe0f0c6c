//! Figure 6: the step width D.

use image::RgbImage;
use plenoctree::reference::Posterization;
use plenoctree_cli::{renderer::PosterizeSettings, result::Result, turntable::turned};

use super::{
    super::{crop::Crop, data::Evidence, measures, methods::Method, shot::posterize},
    rows::{COLUMNS, PART_COLUMNS, cells, note, opaque},
};
use crate::coherence::mean_difference;
use crate::plot::{self, COLORS, Line};
use crate::report::{Cell, Picture, Section, Table};

/// The step widths to compare, in encoded sRGB. 0 is a hard edge.
const WIDTHS: [f64; 6] = [0.0, 0.05, 0.1, 0.2, 0.3, 0.4];
/// The index of the default width.
const DEFAULT: usize = 3;
/// Half a degree, in radians: the turn between neighboring frames.
const TURN: f64 = std::f64::consts::PI / 360.0;

/// Compares step widths.
pub fn section(evidence: &mut Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 6: the step width D");
    section.text(
        "The same view and palette (the paper's hull), with step widths from 0 to 0.4. The second row enlarges the \
         part of the view that changes most, and the last columns are about this part. Flicker is the mean absolute \
         difference of encoded sRGB between this view and the view half a degree further.",
    );
    let palette = evidence.methods.palette(Method::Hull).clone();
    let camera = evidence.shots[0].camera;
    let next = turned(&evidence.field, &camera, TURN);
    let original = evidence.shots[0].original.clone();
    let after = evidence.renderer.original(&next)?;
    let trained = mean_difference(&opaque(&original), &opaque(&after));

    let mut images: Vec<RgbImage> = Vec::new();
    let (mut rows, mut notes, mut flickers) = (Vec::new(), Vec::new(), Vec::new());
    for softness in WIDTHS {
        let posterization = Posterization { softness, ..Default::default() };
        let settings = PosterizeSettings { posterization, ..Default::default() };
        let mut find = |camera, original| posterize(&mut *evidence.renderer, camera, original, &palette, settings);
        let (here, there) = (find(&camera, &original)?, find(&next, &after)?);
        let flicker = mean_difference(&here.image, &there.image);
        let mut row = vec![Cell::Number(softness, 2)];
        row.extend(cells(here.errors));
        row.extend([Cell::Number(flicker, 5), Cell::Number(trained, 5)]);
        rows.push(row);
        notes.push(note(here.errors));
        flickers.push((softness, flicker));
        images.push(here.image);
    }
    let (hard, soft) = (flickers[0].1, flickers[DEFAULT].1);
    section.claim(
        "Soft assignment makes neighboring frames more alike.",
        format!("flicker {soft:.5} with D = {}, {hard:.5} with hard edges", WIDTHS[DEFAULT]),
        soft < hard,
    );
    let crop = Crop::of_difference(&images[0], &images[images.len() - 1]);
    let (mut wholes, mut parts) = (Vec::new(), Vec::new());
    for (((image, row), softness), whole) in images.iter().zip(&mut rows).zip(WIDTHS).zip(notes) {
        let name = format!("softness_{:02.0}", 100.0 * softness);
        let title = format!("D = {softness}");
        let file = evidence.folder.picture(&name, image)?;
        wholes.push(Picture { file, title: title.clone(), note: whole, palette: None });
        let errors = measures::of_picture(&crop.part(&original), &crop.part(image));
        row.extend(cells(errors));
        let file = evidence.folder.picture(&format!("{name}_part"), &crop.enlarged(image))?;
        parts.push(Picture { file, title: format!("{title}, a part"), note: note(errors), palette: None });
    }
    section.pictures(wholes);
    section.pictures(parts);
    let mut head = vec![("D", "d")];
    head.extend(COLUMNS);
    head.extend([("flicker", "flicker"), ("flicker as trained", "flicker_as_trained")]);
    head.extend(PART_COLUMNS);
    section.table(&evidence.folder, "figure_06", Table { head, rows })?;

    let ends = [WIDTHS[0], WIDTHS[WIDTHS.len() - 1]];
    let lines = [
        Line { label: "posterized".into(), color: COLORS[1], dashed: false, points: flickers },
        Line {
            label: "as trained".into(),
            color: COLORS[0],
            dashed: true,
            points: ends.map(|width| (width, trained)).into(),
        },
    ];
    let svg = plot::lines("Flicker over half a degree", "step width D", "difference", &lines);
    section.plot(evidence.folder.plot("figure_06", &svg)?, "flicker over the step width");
    Ok(section)
}
