//! Figure 9: palettes from raw samples.

use plenoctree_cli::result::Result;

use super::super::{data::Evidence, methods::Method};
use crate::report::{Cell, Section};

/// Compares palettes from raw samples with those from visible colors.
pub fn section(evidence: &Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 9: palettes from raw radiance samples");
    let [first, last] = evidence.methods.losses;
    section.text(format!(
        "640,000 colors, drawn at random among all leaves and all 64 directions of the field's sampling, seen or not. \
         Tan et al. 2016 simplify their convex hull. Wang et al. 2019 optimize that hull: their loss is 20 times the \
         mean distance of the colors from the palette's polyhedron (reconstruction), plus the mean distance of each \
         palette color from the center of the 0.1 % of the colors that are nearest to it (representativeness). It fell \
         from {first:.4} to {last:.4} here. Our choices: the polyhedron is the convex hull of the palette, the loss is \
         measured on 40,000 of the colors, and the number of colors is given.",
    ));
    let methods = [Method::Tan, Method::Wang, Method::Hull, Method::Fitted];
    section.pictures(evidence.first_view(&methods)?);
    evidence.claim(
        &mut section,
        "Visible colors give a better palette than the hull of raw samples.",
        [Method::Hull, Method::Tan],
    );
    evidence.claim(
        &mut section,
        "Visible colors give a better palette than an optimized hull of raw samples.",
        [Method::Hull, Method::Wang],
    );
    let mut table = evidence.means(&methods);
    table.head.push(("loss", "loss"));
    for (row, loss) in table.rows.iter_mut().zip([Some(first), Some(last), None, None]) {
        row.push(Cell::number(loss, 4));
    }
    section.table(&evidence.folder, "figure_09", table)?;
    Ok(section)
}
