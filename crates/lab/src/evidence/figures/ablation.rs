//! Figure 10: k-means without visibility; and mean shift.

use plenoctree_cli::{number::counted, result::Result};

use super::super::{data::Evidence, methods::Method};
use crate::report::{Cell, Section};

/// Compares ways to filter samples before the hull.
pub fn section(evidence: &Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 10: filtering without visibility, and mean shift");
    section.text(format!(
        "The same k-means with and without visibility: on the weighted histogram, and on the 640,000 raw samples. The \
         initial centers are the same, those of the field's own extraction. In the third picture, mean shift (a \
         Gaussian kernel with a standard deviation of one and a half fine bins) takes the place of k-means on the \
         weighted histogram. It found {} with more than 0.8 % of the weight.",
        counted(evidence.methods.modes, "mode", "modes"),
    ));
    let methods = [Method::Unweighted, Method::Hull, Method::MeanShift];
    section.pictures(evidence.first_view(&methods)?);
    evidence.claim(
        &mut section,
        "K-means with visibility gives a better palette than without.",
        [Method::Hull, Method::Unweighted],
    );
    evidence.claim(
        &mut section,
        "Mean shift, which the paper suggests, does better than k-means.",
        [Method::MeanShift, Method::Hull],
    );
    // Both k-means have the same initial centers.
    let clusters = evidence.extractions[Method::Hull as usize].report.clusters;
    let mut table = evidence.means(&methods);
    table.head.push(("clusters or modes", "clusters"));
    for (row, count) in table.rows.iter_mut().zip([clusters, clusters, Some(evidence.methods.modes)]) {
        row.push(Cell::number(count.map(|count| count as f64), 0));
    }
    section.table(&evidence.folder, "figure_10", table)?;
    Ok(section)
}
