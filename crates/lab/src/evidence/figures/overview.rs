//! All palettes at a glance.

use plenoctree::{palette::ColorErrors, reference::Posterization};
use plenoctree_cli::{hex, result::Result};

use super::{
    super::{data::Evidence, methods::Method},
    rows::{COLUMNS, cells},
};
use crate::report::{Cell, Section, Table};

/// Lists every palette with its figures, and writes every color and the figures of every picture to files.
pub fn section(evidence: &Evidence) -> Result<Section> {
    let mut section = Section::new("Palettes");
    section.text(
        "Every palette that this report compares. The first figures say how far the visible colors of the whole field \
         are from their nearest labels (equation 7), weighted by visibility; the others, how far posterized pictures \
         are from their originals, over views that no palette was made from, weighted by opacity. RMSE is the root of \
         the mean squared difference of a channel, of 255. Hue errors are the share of the chromatic weight that is \
         shown with an Oklab hue more than 45 degrees off.",
    );
    section.text(
        "Below each color of a palette stands the share of what the palette was made from that is nearest to it: of \
         the visible weight, of the pixels, or of the raw samples.",
    );
    let steps = Posterization::default().blend_steps;
    let mut head = vec![
        ("palette", "palette"),
        ("colors", "colors"),
        ("field: RMSE, of 255", "field_rmse"),
        ("field: hue errors, %", "field_hue_errors_percent"),
    ];
    head.extend(COLUMNS);
    head.insert(1, ("", "drawing"));
    let rows = Method::ALL.map(|method| {
        let palette = evidence.methods.palette(method);
        let field = ColorErrors::of_labels(&evidence.histograms, palette, steps);
        let views = evidence.mean(method);
        let mut row = vec![
            Cell::name(method.label(), method.name()),
            Cell::Image(evidence.drawings[method as usize].clone()),
            Cell::Number(palette.colors.len() as f64, 0),
            Cell::Number(255.0 * field.rmse, 2),
            Cell::Number(100.0 * field.hue, 2),
        ];
        row.extend(cells(views));
        row
    });
    section.table(&evidence.folder, "overview", Table { head, rows: rows.into() })?;
    colors(evidence)?;
    views(evidence)?;
    Ok(section)
}

/// Writes every color of every palette.
fn colors(evidence: &Evidence) -> Result {
    let mut rows = Vec::new();
    for method in Method::ALL {
        let palette = evidence.methods.palette(method);
        for (index, (color, weight)) in palette.colors.iter().zip(&palette.weights).enumerate() {
            let mut row = vec![Cell::text(method.name()), Cell::Number(index as f64, 0)];
            row.extend(color.map(|channel| Cell::Number(channel, 4)));
            row.extend([Cell::text(hex::format(hex::quantize(*color))), Cell::Number(*weight, 4)]);
            rows.push(row);
        }
    }
    let head = ["palette", "index", "r", "g", "b", "hex", "weight"].map(|name| (name, name)).to_vec();
    evidence.folder.csv("palettes", &Table { head, rows }).map(|_| ())
}

/// Writes the figures of every view, posterized with every palette.
fn views(evidence: &Evidence) -> Result {
    let mut rows = Vec::new();
    for (view, shot) in evidence.shots.iter().enumerate() {
        for method in Method::ALL {
            let mut row = vec![Cell::Number(view as f64, 0), Cell::text(method.name())];
            row.extend(cells(shot.posterized(method).errors));
            rows.push(row);
        }
    }
    let mut head = vec![("view", "view"), ("palette", "palette")];
    head.extend(COLUMNS);
    evidence.folder.csv("views", &Table { head, rows }).map(|_| ())
}
