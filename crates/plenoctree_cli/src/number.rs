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

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn only_one_is_singular() {
        assert_eq!([0, 1, 2].map(|number| counted(number, "leaf", "leaves")), ["0 leaves", "1 leaf", "2 leaves"]);
    }
}
