//! Figure 11: where the hull fails.

use image::{RgbImage, RgbaImage};
use plenoctree::palette::ColorErrors;
use plenoctree_cli::{renderer::PosterizeSettings, result::Result};

use super::{
    super::{
        crop::Crop,
        data::Evidence,
        measures,
        methods::Method,
        shot::{Posterized, posterize},
    },
    rows::{COLUMNS, PART_COLUMNS, cells, note, opaque},
};
use crate::report::{Cell, Picture, Section, Table};

/// The palettes to compare.
const METHODS: [Method; 2] = [Method::Hull, Method::Fitted];

/// The view whose error falls most.
struct Failure {
    view: usize,
    fall: f64,
    original: RgbaImage,
    /// The view posterized with each of [`METHODS`].
    posterized: [Posterized; 2],
}

/// Shows the view whose error falls most from the hull's palette to the fitted one, of all views of the report.
pub fn section(evidence: &mut Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 11: where the hull fails");
    section.text(
        "Colors inside the convex hull have no palette color of their own. This is the view whose error falls most \
         from the hull's palette to the fitted one, of all views in this report, and below it the part of the view \
         where the error falls most. The first views are those that show results; the others are the examples.",
    );
    evidence.claim(
        &mut section,
        "An optimized palette does better than the hull (left to future work).",
        [Method::Fitted, Method::Hull],
    );
    let cameras = [&evidence.views.shown[..], &evidence.views.examples].concat();
    let mut most: Option<Failure> = None;
    let mut rows = Vec::new();
    for (view, camera) in cameras.iter().enumerate() {
        let original = evidence.renderer.original(camera)?;
        let mut find = |method| {
            let palette = evidence.methods.palette(method);
            posterize(&mut *evidence.renderer, camera, &original, palette, PosterizeSettings::default())
        };
        let posterized = [find(METHODS[0])?, find(METHODS[1])?];
        for (method, posterized) in METHODS.iter().zip(&posterized) {
            let mut row = vec![Cell::Number(view as f64, 0), Cell::text(method.name())];
            row.extend(cells(posterized.errors));
            rows.push(row);
        }
        let [Some(hull), Some(fitted)] = [0, 1].map(|index| posterized[index].errors) else { continue };
        let fall = hull.rmse - fitted.rmse;
        if most.as_ref().is_none_or(|most| fall > most.fall) {
            most = Some(Failure { view, fall, original, posterized });
        }
    }
    if let Some(most) = most {
        let parts = pictures(evidence, &mut section, &most)?;
        for (index, row) in rows.iter_mut().enumerate() {
            let (view, method) = (index / METHODS.len(), index % METHODS.len());
            row.extend(cells(parts[method].filter(|_| view == most.view)));
        }
    }
    let mut head = vec![("view", "view"), ("palette", "palette")];
    head.extend(COLUMNS);
    if rows.iter().all(|row| row.len() > head.len()) {
        head.extend(PART_COLUMNS);
    }
    section.table(&evidence.folder, "figure_11", Table { head, rows })?;
    Ok(section)
}

/// Shows the view, and below it the part where the error falls most. Returns the errors of the parts.
fn pictures(evidence: &Evidence, section: &mut Section, most: &Failure) -> Result<[Option<ColorErrors>; 2]> {
    let original = opaque(&most.original);
    let off = |a: &RgbImage, x, y| {
        let (a, b) = (a.get_pixel(x, y), original.get_pixel(x, y));
        a.0.iter().zip(b.0).map(|(a, b)| f64::from(a.abs_diff(b)).powi(2)).sum::<f64>()
    };
    let [hull, fitted] = &most.posterized;
    let crop = Crop::of_most(original.dimensions(), |x, y| off(&hull.image, x, y) - off(&fitted.image, x, y));
    let mut rows = [Vec::new(), Vec::new()];
    let mut show = |name: &str, title: &str, image: &RgbImage, notes: [String; 2], palette: Option<String>| -> Result {
        let [whole, part] = notes;
        let file = evidence.folder.picture(&format!("hull_failure_{name}"), image)?;
        rows[0].push(Picture { file, title: title.into(), note: whole, palette });
        let file = evidence.folder.picture(&format!("hull_failure_{name}_part"), &crop.enlarged(image))?;
        rows[1].push(Picture { file, title: format!("{title}, a part"), note: part, palette: None });
        Ok(())
    };
    show("original", "as trained", &original, [format!("view {}", most.view), String::new()], None)?;
    let mut parts = [None; 2];
    for ((method, posterized), errors) in METHODS.iter().zip(&most.posterized).zip(&mut parts) {
        *errors = measures::of_picture(&crop.part(&most.original), &crop.part(&posterized.image));
        let drawing = evidence.drawings[*method as usize].clone();
        let notes = [note(posterized.errors), note(*errors)];
        show(method.name(), method.name(), &posterized.image, notes, Some(drawing))?;
    }
    rows.into_iter().for_each(|row| section.pictures(row));
    Ok(parts)
}
