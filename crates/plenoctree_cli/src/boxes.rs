//! Boxes on the command line.

use glam::DVec3;

/// Parses the lowest and the highest corner of a box.
pub fn parse_box(text: &str) -> Result<(DVec3, DVec3), String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[a, b, c, d, e, f]) => Ok((DVec3::new(a, b, c), DVec3::new(d, e, f))),
        _ => Err("expected six numbers, separated by commas".into()),
    }
}
