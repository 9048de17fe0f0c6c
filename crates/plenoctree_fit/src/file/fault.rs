//! Errors in the content of a file, before the name of the file is known.

/// An error in the content of a file, before the name of the file is known.
#[derive(Clone, Debug)]
pub struct Fault {
    /// The part of the file, such as a property.
    pub what: String,
    /// What was found.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl Fault {
    pub fn found(what: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { what: printable(&what.into()), found: printable(&found.into()), expected: expected.into() }
    }
}

/// Fits the start of a text from a file on one line of a message.
pub fn printable(text: &str) -> String {
    const LONGEST: usize = 200;
    text.replace(char::is_control, "?").chars().take(LONGEST).collect()
}
