//! Waits until a frame can be captured without a window.

use std::time::Duration;

use bevy_plenoctree::headless::Headless;

use crate::{
    loader::Loader,
    notices::Notices,
    show::{Result, wait_for_props},
};

/// Frames until the camera has framed the field and the UI has its final size.
const SETTLING: u32 = 3;

/// Updates the viewer until it shows the field and palette from the command line.
pub fn wait(headless: &mut Headless) -> Result {
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
    wait_for_props(headless)?;
    for _ in 0..SETTLING {
        headless.update();
    }
    Ok(())
}
