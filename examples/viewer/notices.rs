//! Messages for the user.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use bevy::prelude::*;

const LIFETIME: Duration = Duration::from_secs(8);
const MAX_NOTICES: usize = 4;

#[derive(Resource, Default)]
pub struct Notices {
    pub list: Vec<Notice>,
    /// Whether a file is being dragged over the window.
    pub dropping: bool,
}

pub struct Notice {
    pub text: String,
    /// When the notice disappears. `None` for errors, which stay until they are closed.
    pub until: Option<Instant>,
}

impl Notices {
    /// Adds a message that disappears after a while.
    pub fn info(&mut self, text: String) {
        info!("{text}");
        self.add(Notice { text, until: Some(Instant::now() + LIFETIME) });
    }

    /// Adds an error, which stays until it is closed.
    pub fn error(&mut self, text: String) {
        error!("{text}");
        self.add(Notice { text, until: None });
    }

    /// Removes earlier errors, which no longer matter.
    pub fn forget_errors(&mut self) {
        self.list.retain(|notice| notice.until.is_some());
    }

    pub fn first_error(&self) -> Option<&str> {
        self.list.iter().find(|notice| notice.until.is_none()).map(|notice| notice.text.as_str())
    }

    fn add(&mut self, notice: Notice) {
        self.list.retain(|old| old.text != notice.text);
        self.list.push(notice);
        let surplus = self.list.len().saturating_sub(MAX_NOTICES);
        self.list.drain(..surplus);
    }
}

/// Returns the name of a file without its folder.
pub fn name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
