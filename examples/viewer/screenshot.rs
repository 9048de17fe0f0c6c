//! Screenshots of the window.

use std::{
    fs::{File, OpenOptions},
    io::{self, BufWriter},
};

use bevy::{
    prelude::*,
    render::view::screenshot::{Screenshot, ScreenshotCaptured},
};

use crate::{action::Action, notices::Notices, show::Result};

pub fn take(mut actions: MessageReader<Action>, mut commands: Commands) {
    for action in actions.read() {
        if *action == Action::Screenshot {
            commands.spawn(Screenshot::primary_window()).observe(save);
        }
    }
}

fn save(captured: On<ScreenshotCaptured>, mut notices: ResMut<Notices>) {
    match write(&captured.image) {
        Ok(name) => notices.info(format!("Saved the screenshot: {name}")),
        Err(error) => notices.error(format!("The screenshot could not be saved: {error}")),
    }
}

/// Saves a screenshot and returns the name of its file.
fn write(screenshot: &Image) -> Result<String> {
    let screenshot = screenshot.clone().try_into_dynamic()?.to_rgb8();
    let (name, file) = next_free()?;
    let mut file = BufWriter::new(file);
    screenshot.write_to(&mut file, image::ImageFormat::Png)?;
    io::Write::flush(&mut file)?;
    Ok(name)
}

/// Creates the first of `viewer_000.png`, `viewer_001.png` and so on that does not exist yet, in the current folder.
fn next_free() -> io::Result<(String, File)> {
    for number in 0.. {
        let name = format!("viewer_{number:03}.png");
        match OpenOptions::new().write(true).create_new(true).open(&name) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && number < 9999 => {}
            result => return result.map(|file| (name, file)),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}
