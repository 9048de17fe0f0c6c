//! What the paper claims, and whether it holds here.

use plenoctree_cli::{number::counted, result::Result};

use super::super::data::Evidence;
use crate::report::{Cell, Section, Table};

/// Describes the report, and lists the claims of all sections.
pub fn section(evidence: &Evidence, sections: &[Section]) -> Result<Section> {
    let mut section = Section::new("What the paper claims");
    let (field, camera, adapter) = (&evidence.field, evidence.shots[0].camera, evidence.renderer.adapter());
    section.text(
        "This report repeats the comparisons of Tojo and Umetani, Recolorable Posterization of Volumetric Radiance \
         Fields Using Visibility-Weighted Palette Extraction (EGSR 2022), on another field.",
    );
    section.text(format!(
        "The field {} has {} at depth {} ({}). Pictures are {} x {} pixels over white, by {} ({}). Wherever a \
         claim is about the quality of a palette, it holds if the mean PSNR of the posterized pictures is higher.",
        evidence.name,
        counted(field.leaves(), "leaf", "leaves"),
        field.depth(),
        field.basis().name(),
        camera.width,
        camera.height,
        adapter.name,
        adapter.backend,
    ));
    let rows = sections.iter().flat_map(Section::claims).map(|claim| {
        let figure = claim.section.split(':').next().unwrap_or_default();
        let holds = if claim.holds { "yes" } else { "no" };
        [figure, claim.claim, &claim.found, holds].map(Cell::text).into()
    });
    let head = vec![("shown in", "figure"), ("claim", "claim"), ("found here", "found"), ("holds", "holds")];
    section.table(&evidence.folder, "claims", Table { head, rows: rows.collect() })?;
    Ok(section)
}
