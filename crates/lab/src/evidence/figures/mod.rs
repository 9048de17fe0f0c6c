//! The figures, in the order of the paper. Each is a section of the report.

mod ablation;
mod claims;
mod cut;
mod gallery;
mod hull_failure;
mod label_space;
mod neighbors;
mod overview;
mod raw;
mod rows;
mod softness;
mod times;
mod views;

use image::RgbaImage;
use plenoctree_cli::{progress, result::Result};

use super::{arguments::Arguments, data::Evidence};
use crate::report::Section;

/// Makes all figures. `examples` are the example views as trained.
pub fn all(evidence: &mut Evidence, examples: &[RgbaImage], arguments: &Arguments) -> Result<Vec<Section>> {
    let bar = progress::bar("figures", 10, arguments.quiet);
    let mut sections = Vec::new();
    let mut add = |section: Result<Section>| -> Result {
        sections.push(section?);
        bar.inc(1);
        Ok(())
    };
    add(overview::section(evidence))?;
    add(cut::section(evidence))?;
    add(gallery::section(evidence))?;
    add(label_space::section(evidence))?;
    add(softness::section(evidence))?;
    add(views::section(evidence, examples))?;
    add(raw::section(evidence))?;
    add(ablation::section(evidence))?;
    add(hull_failure::section(evidence))?;
    add(times::section(evidence, arguments.renderer))?;
    bar.finish_and_clear();
    // Figure 7 has its own bar, because it takes as long as all others together.
    sections.insert(5, neighbors::section(evidence, arguments)?);
    sections.insert(0, claims::section(evidence, &sections)?);
    Ok(sections)
}
