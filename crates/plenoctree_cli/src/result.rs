//! The result of a step of a command.

/// The result of a step of a command. Errors are messages for the user.
pub type Result<T = (), E = Box<dyn std::error::Error>> = std::result::Result<T, E>;
