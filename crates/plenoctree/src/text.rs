//! Text from files, for messages.

/// Fits text on one line, as names and words in files may hold control characters.
pub fn one_line(text: &str) -> String {
    text.replace(char::is_control, "?")
}
