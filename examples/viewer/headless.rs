//! One picture and no window.

use std::{path::Path, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::headless::Headless;

use crate::{Result, Viewer, arguments::Arguments, loader::Loader, notices::Notices, scene};

const PATIENCE: Duration = Duration::from_secs(3600);
/// Frames until the camera has found the field and the interface its size.
const SETTLING: u32 = 3;

pub fn picture(viewer: Viewer, arguments: &Arguments, file: &Path) -> Result<()> {
    let mut headless = Headless::new(arguments.size.into(), |app| viewer.build(app))?;
    let target = headless.target();
    scene::spawn_cameras(headless.app.world_mut(), target);

    loop {
        headless.update();
        let world = headless.app.world();
        if let Some(error) = world.resource::<Notices>().first_error() {
            return Err(error.into());
        }
        if world.resource::<Loader>().shown().is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    headless.wait_until_ready(PATIENCE)?;
    for _ in 0..SETTLING + arguments.at_frame {
        headless.update();
    }
    headless.picture()?.save(file).map_err(|error| format!("{}: {error}", file.display()))?;
    println!("{}", file.display());
    Ok(())
}
