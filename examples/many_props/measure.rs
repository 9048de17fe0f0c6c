//! How long frames take.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_plenoctree::headless::Headless;

use crate::show::Result;

/// Frames whose mean is taken.
const FRAMES: u32 = 4;

/// Once a second: the mean of the frames since.
pub fn print_pace(time: Res<Time<Real>>, mut frames: Local<u32>, mut elapsed: Local<Duration>) {
    *frames += 1;
    *elapsed += time.delta();
    if *elapsed >= Duration::from_secs(1) {
        println!("{:.1} ms a frame", milliseconds(*elapsed, *frames));
        (*frames, *elapsed) = (0, Duration::ZERO);
    }
}

/// Frames from their beginning until the picture is in memory: what the CPU and the GPU, or its software, do for them.
pub fn time_frames(headless: &mut Headless, count: u32) -> Result {
    // The first one compiles.
    headless.capture()?;
    let start = Instant::now();
    for _ in 0..FRAMES {
        headless.capture()?;
    }
    println!("{count} props: {:.1} ms a frame, the mean of {FRAMES}", milliseconds(start.elapsed(), FRAMES));
    Ok(())
}

fn milliseconds(elapsed: Duration, frames: u32) -> f64 {
    1e3 * elapsed.as_secs_f64() / f64::from(frames)
}
