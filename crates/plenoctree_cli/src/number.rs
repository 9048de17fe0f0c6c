//! Numbers on the command line.

/// Parses a number above 0.
pub fn parse_positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| *number > 0.0 && *number < 1e6);
    number.ok_or_else(|| "expected a number above 0 and below 1000000".into())
}
