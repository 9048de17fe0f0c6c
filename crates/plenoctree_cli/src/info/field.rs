//! Describes a field.

use std::path::Path;

use glam::DVec3;
use plenoctree::{PlenOctree, UpAxis, sampling::SamplingSettings};
use serde_json::{Value, json};

use super::report::{NONE, Report, size, table};
use crate::{field, files, gpu_memory, number::significant, result::Result};

/// The lowest and the highest corner of a box.
type Bounds = (DVec3, DVec3);

/// Reads a field and describes it.
pub fn report(path: &Path) -> Result<Report> {
    let field = field::load(path, false)?;
    let file_bytes = files::size(path)?;
    let gpu_bytes = gpu_memory::bytes(&field);
    let densities = densities(&field);
    let up = if field.up() == UpAxis::Y { "y" } else { "z" };
    let records_histograms = field.histograms(&SamplingSettings::default()).is_some();

    let mut lines = vec![
        ("file size", size(file_bytes)),
        ("basis", field.basis().name().into()),
        ("activation", format!("{:?}", field.activation())),
        ("up axis", up.into()),
        ("leaves", field.leaves().to_string()),
        ("nodes", field.nodes().len().to_string()),
        ("depth", field.depth().to_string()),
        ("bounds", bounds_text(field.bounds())),
        ("dense bounds", bounds_text(field.dense_bounds())),
        ("coefficients", codebook_text(&field)),
        ("density", densities.map_or(NONE.into(), densities_text)),
        ("histograms", if records_histograms { "recorded" } else { "not recorded" }.into()),
    ];
    lines.extend(gpu_bytes.map(|bytes| ("GPU memory", size(bytes))));

    let json = json!({
        "file": path.display().to_string(),
        "file_bytes": file_bytes,
        "basis": field.basis().name(),
        "activation": format!("{:?}", field.activation()),
        "up": up,
        "leaves": field.leaves(),
        "nodes": field.nodes().len(),
        "depth": field.depth(),
        "bounds": bounds_json(field.bounds()),
        "dense_bounds": bounds_json(field.dense_bounds()),
        "codebook_rows": rows(&field),
        "density": densities.map(|[min, median, max]| json!({"min": min, "median": median, "max": max})),
        "records_histograms": records_histograms,
        "gpu_bytes": gpu_bytes,
    });
    Ok(Report { text: table(path, &lines), json })
}

/// Returns the number of rows of a packed field's codebooks: of luma, and of differences.
fn rows(field: &PlenOctree) -> Option<[usize; 2]> {
    let others = field.basis().functions() - 1;
    let count = |length: usize, width: usize| length.checked_div(width).unwrap_or(0);
    field.codebook().map(|codebook| [count(codebook.luma.len(), others), count(codebook.chroma.len(), 2 * others)])
}

fn codebook_text(field: &PlenOctree) -> String {
    rows(field).map_or("of every leaf".into(), |[luma, chroma]| format!("packed, {luma} and {chroma} rows"))
}

/// Returns the lowest, the median and the highest density, or `None` for an empty field.
fn densities(field: &PlenOctree) -> Option<[f32; 3]> {
    let mut all = field.densities().to_vec();
    let min = all.iter().copied().min_by(f32::total_cmp)?;
    let max = all.iter().copied().max_by(f32::total_cmp)?;
    let middle = all.len() / 2;
    Some([min, *all.select_nth_unstable_by(middle, f32::total_cmp).1, max])
}

fn densities_text([min, median, max]: [f32; 3]) -> String {
    let [min, median, max] = significant([min, median, max].map(f64::from));
    format!("min {min}, median {median}, max {max}")
}

fn bounds_text(bounds: Option<Bounds>) -> String {
    let text = |(low, high): Bounds| {
        let numbers = significant([low.x, low.y, low.z, high.x, high.y, high.z]);
        format!("{} to {}", numbers[..3].join(" "), numbers[3..].join(" "))
    };
    bounds.map_or(NONE.into(), text)
}

fn bounds_json(bounds: Option<Bounds>) -> Value {
    bounds.map_or(Value::Null, |(low, high)| json!({"min": low.to_array(), "max": high.to_array()}))
}
