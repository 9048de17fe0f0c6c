//! Numbers on the command line and in messages.

/// Counts things: "1 leaf", "2 leaves".
pub fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// Parses a number above 0.
pub fn parse_positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| *number > 0.0 && *number < 1e6);
    number.ok_or_else(|| "expected a number above 0 and below 1000000".into())
}

/// Parses a distance in a capture, whose coordinates may be as large as a billion.
pub fn parse_distance(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| *number > 0.0 && *number < 1e10);
    number.ok_or_else(|| "expected a number above 0 and below 1e10".into())
}

/// Returns numbers of the same kind as text: with four decimals, or in scientific notation if the largest has no two
/// digits then.
pub fn significant<const N: usize>(numbers: [f64; N]) -> [String; N] {
    let most = numbers.iter().fold(0.0, |most: f64, number| most.max(number.abs()));
    let is_plain = most == 0.0 || (1e-2..1e9).contains(&most);
    numbers.map(|number| if is_plain { format!("{number:.4}") } else { format!("{number:.3e}") })
}

#[cfg(test)]
mod tests {
    use super::{counted, significant};

    #[test]
    fn small_numbers_have_digits() {
        assert_eq!(significant([0.0, -0.5]), ["0.0000", "-0.5000"]);
        assert_eq!(significant([1.25e-5, 0.0, -2e-3]), ["1.250e-5", "0.000e0", "-2.000e-3"]);
        assert_eq!(significant([1e38]), ["1.000e38"]);
    }

    #[test]
    fn only_one_is_singular() {
        assert_eq!([0, 1, 2].map(|number| counted(number, "leaf", "leaves")), ["0 leaves", "1 leaf", "2 leaves"]);
    }
}
