//! Boxes on the command line.

use glam::DVec3;

/// Largest coordinate.
const MOST: f64 = 1e9;

/// Parses the lowest and the highest corner of a box.
pub fn parse_box(text: &str) -> Result<(DVec3, DVec3), String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let Ok(&[a, b, c, d, e, f]) = numbers.as_deref() else {
        return Err("expected six numbers, separated by commas".into());
    };
    let (low, high) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
    if low.abs().max(high.abs()).max_element() <= MOST && low.cmplt(high).all() {
        Ok((low, high))
    } else {
        Err("expected the lowest corner and then the highest, from -1e9 to 1e9".into())
    }
}

#[cfg(test)]
mod tests {
    use super::parse_box;

    #[test]
    fn boxes_are_checked() {
        assert_eq!(parse_box("-1, 0,1,2,3,4e2"), Ok(((-1.0, 0.0, 1.0).into(), (2.0, 3.0, 400.0).into())));
        for wrong in ["", "1,2,3", "1,1,1,0,0,0", "0,0,0,1,1,nan", "0,0,0,inf,1,1", "0,0,0,0,1,1", "0,0,0,1,1,1,1"] {
            assert!(parse_box(wrong).is_err(), "{wrong}");
        }
    }
}
