//! Times of frames.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use bevy::{
    diagnostic::DiagnosticsStore,
    prelude::*,
    render::{RenderApp, render_resource::PollType, renderer::RenderDevice},
};
use bevy_plenoctree::headless::Headless;

use crate::Result;

/// The largest number of frames that count.
const MOST: u32 = 100;
/// Frames before those that count. In the first one, textures are new. The GPU's times of a frame arrive in the next one,
/// so those of the second one count, too.
pub const WARM_UP: u32 = 2;
/// The same for views in which nothing moves: they draw labels for ten more frames.
pub const COME_TO_REST: u32 = 16;
/// A span of every frame.
const ONCE: &str = "main_opaque_pass_3d";

/// The mean times of frames, in milliseconds.
pub struct Times {
    pub frames: u32,
    pub wall: f64,
    /// The GPU's time of each span.
    spans: BTreeMap<String, f64>,
}

impl Times {
    /// Draws frames until `end`, at least one and at most 100, after some that do not count.
    pub fn measure(headless: &mut Headless, warm_up: u32, end: Instant) -> Result<Self> {
        rest(headless)?;
        for _ in 0..warm_up {
            draw(headless)?;
        }
        let start = Instant::now();
        let mut frames = 0;
        while frames == 0 || (frames < MOST && Instant::now() < end) {
            draw(headless)?;
            frames += 1;
        }
        let wall = 1e3 * start.elapsed().as_secs_f64() / f64::from(frames);
        rest(headless)?;
        let mut spans = BTreeMap::new();
        let mut timed = 1;
        for diagnostic in headless.app.world().resource::<DiagnosticsStore>().iter() {
            let path: Vec<&str> = diagnostic.path().as_str().split('/').collect();
            let ["render", span, "elapsed_gpu"] = path[..] else { continue };
            let measured = diagnostic.measurements().filter(|measured| measured.time > start);
            let times: Vec<f64> = measured.map(|measured| measured.value).collect();
            if span == ONCE {
                timed = times.len().max(1);
            }
            if times.iter().any(|time| *time > 0.0) {
                spans.insert(span.to_string(), times.iter().sum());
            }
        }
        spans.values_mut().for_each(|time: &mut f64| *time /= timed as f64);
        Ok(Self { frames, wall, spans })
    }

    /// Returns the GPU's time of all spans, or `None` if the adapter has no timestamps.
    pub fn gpu(&self) -> Option<f64> {
        self.spans.values().copied().reduce(|sum, time| sum + time)
    }

    /// Returns that of some spans.
    pub fn of(&self, spans: &[&str]) -> Option<f64> {
        spans.iter().filter_map(|span| self.spans.get(*span)).copied().reduce(|sum, time| sum + time)
    }

    /// Returns all spans.
    pub fn spans(&self) -> impl Iterator<Item = (&str, f64)> {
        self.spans.iter().map(|(span, time)| (span.as_str(), *time))
    }
}

/// Draws a frame and waits for the GPU.
pub fn draw(headless: &mut Headless) -> Result {
    headless.update();
    let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
    device.poll(PollType::wait_indefinitely())?;
    Ok(())
}

/// Runs frames that draw nothing, in which the times of earlier ones arrive.
fn rest(headless: &mut Headless) -> Result {
    let activate = |headless: &mut Headless, active| {
        let world = headless.app.world_mut();
        world.query::<&mut Camera>().iter_mut(world).for_each(|mut camera| camera.is_active = active);
    };
    activate(headless, false);
    for _ in 0..6 {
        draw(headless)?;
        std::thread::sleep(Duration::from_millis(2));
    }
    activate(headless, true);
    Ok(())
}

/// Returns a number of milliseconds for a table.
pub fn milliseconds(time: Option<f64>) -> String {
    time.map_or_else(|| "-".to_string(), |time| format!("{time:.2}"))
}
