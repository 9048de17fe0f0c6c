//! Checks of error messages.

/// The maximum length of an error message in bytes, besides what it quotes.
const LONGEST_MESSAGE: usize = 1000;
/// The maximum number of bytes that one quoted byte may become.
const LONGEST_ESCAPE: usize = 10;

/// Checks that an error message is one line. It may quote `quoted` bytes of the file, because `serde_json` does not
/// shorten its quotes.
pub fn check_message(error: &dyn std::error::Error, quoted: usize) {
    let message = error.to_string();
    assert!(message.len() < LONGEST_MESSAGE + LONGEST_ESCAPE * quoted, "a message of {} bytes", message.len());
    assert!(!message.contains(char::is_control), "{message:?}");
}
