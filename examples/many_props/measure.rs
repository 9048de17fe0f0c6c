//! Measures frame times.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_plenoctree::headless::Headless;

use crate::show::Result;

/// The number of frames to average.
const FRAMES: u32 = 4;

/// Prints the mean frame time once a second.
pub fn print_frame_time(time: Res<Time<Real>>, mut frames: Local<u32>, mut elapsed: Local<Duration>) {
    *frames += 1;
    *elapsed += time.delta();
    if *elapsed >= Duration::from_secs(1) {
        println!("{:.1} ms per frame", milliseconds(*elapsed, *frames));
        (*frames, *elapsed) = (0, Duration::ZERO);
    }
}

/// Prints the mean time from the start of a frame until it is in memory: the work of the CPU and of the GPU or its
/// software replacement.
pub fn time_frames(headless: &mut Headless, count: u32) -> Result {
    // The first frame compiles pipelines.
    headless.capture()?;
    let start = Instant::now();
    for frame in 0..FRAMES {
        // A view that does not change is not drawn again.
        let world = headless.app.world_mut();
        for mut camera in world.query_filtered::<&mut Transform, With<Camera3d>>().iter_mut(world) {
            camera.translation.x += if frame % 2 == 0 { 1e-4 } else { -1e-4 };
        }
        headless.capture()?;
    }
    println!("{count} props: {:.1} ms per frame, the mean of {FRAMES}", milliseconds(start.elapsed(), FRAMES));
    Ok(())
}

fn milliseconds(elapsed: Duration, frames: u32) -> f64 {
    1e3 * elapsed.as_secs_f64() / f64::from(frames)
}
