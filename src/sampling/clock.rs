//! Measures how long a slice takes on the GPU.

use std::{
    sync::{Arc, OnceLock},
    time::Duration,
};

use bevy::{
    platform::time::Instant,
    render::{
        render_resource::{
            BufferDescriptor, BufferUsages, CommandEncoderDescriptor, ComputePass, ComputePassDescriptor, MapMode,
        },
        renderer::{RenderDevice, RenderQueue},
    },
};
use wgpu::{ComputePassTimestampWrites, Features, QuerySetDescriptor, QueryType};

/// The longest time for which a slice waits for other work of a frame, and its end to be noticed, without being slow
/// itself, in seconds.
const MOST_LATENCY: f64 = 1.0 / 30.0;
/// What the wall clock cannot tell from waiting, in seconds.
const RESOLUTION: f64 = 2e-3;

/// How fast the GPU samples.
pub(super) struct Pace {
    /// In leaves per second, once it is known.
    speed: Option<f64>,
    /// The shortest time that a slice took by the wall clock, in seconds.
    shortest: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Self { speed: None, shortest: MOST_LATENCY }
    }
}

impl Pace {
    /// Adds a slice that took this many seconds: on the GPU if that is `accurate`. Otherwise, the shortest time in which
    /// slices are done counts as waiting, or they would shrink from frame to frame although the GPU is idle.
    pub fn add(&mut self, leaves: u32, seconds: f64, accurate: bool) {
        let work = if accurate {
            seconds.max(1e-6)
        } else {
            self.shortest = self.shortest.min(seconds);
            (seconds - self.shortest).max(RESOLUTION)
        };
        self.speed = Some(f64::from(leaves) / work);
    }

    /// Returns the number of leaves that are probably sampled in this time, or 0 if the speed is not known.
    pub fn leaves_within(&self, time: Duration) -> f64 {
        self.speed.map_or(0.0, |speed| speed * time.as_secs_f64())
    }
}

/// Measures one submission.
pub(super) struct SliceClock {
    /// The number of leaves in the slice, or 0 if it is one of views.
    pub leaves: u32,
    /// Whether it measures only the time that the GPU takes.
    pub is_accurate: bool,
    seconds: Arc<OnceLock<f64>>,
}

impl SliceClock {
    /// Submits a compute pass with what `record` adds to it, and measures it: with GPU timestamps if that must be
    /// accurate and the adapter supports them, otherwise in wall-clock time.
    pub fn submit(
        label: &str,
        leaves: u32,
        is_accurate: bool,
        device: &RenderDevice,
        queue: &RenderQueue,
        record: impl FnOnce(&mut ComputePass),
    ) -> Self {
        let is_accurate = is_accurate && device.features().contains(Features::TIMESTAMP_QUERY);
        let timestamps = is_accurate.then(|| {
            let label = Some("plenoctree_slice_clock");
            let buffer =
                |usage| device.create_buffer(&BufferDescriptor { label, size: 16, usage, mapped_at_creation: false });
            let descriptor = QuerySetDescriptor { label, ty: QueryType::Timestamp, count: 2 };
            let queries = device.wgpu_device().create_query_set(&descriptor);
            let resolved = buffer(BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC);
            (queries, resolved, buffer(BufferUsages::MAP_READ | BufferUsages::COPY_DST))
        });
        let timestamp_writes = timestamps.as_ref().map(|(query_set, ..)| ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        });
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        record(&mut encoder.begin_compute_pass(&ComputePassDescriptor { label: Some(label), timestamp_writes }));
        if let Some((queries, resolved, readable)) = &timestamps {
            encoder.resolve_query_set(queries, 0..2, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, readable, 0, 16);
        }
        queue.submit([encoder.finish()]);
        let clock = Self { leaves, is_accurate, seconds: Arc::default() };
        let (start, seconds) = (Instant::now(), clock.seconds.clone());
        let Some((.., readable)) = timestamps else {
            queue.on_submitted_work_done(move || _ = seconds.set(start.elapsed().as_secs_f64()));
            return clock;
        };
        let nanoseconds = f64::from(queue.get_timestamp_period());
        readable.clone().slice(..).map_async(MapMode::Read, move |result| {
            // If the device was lost, there is nothing to read, and some drivers write nothing. The slice still has to count
            // as done, and as work.
            let ticks = result.ok().and_then(|()| {
                let mapped = readable.slice(..).get_mapped_range();
                let [begin, end] = [0, 8].map(|at| bytemuck::pod_read_unaligned::<u64>(&mapped[at..at + 8]));
                end.checked_sub(begin).filter(|ticks| *ticks > 0)
            });
            let measured = ticks.map_or_else(|| start.elapsed().as_secs_f64(), |t| t as f64 * nanoseconds * 1e-9);
            let _ = seconds.set(measured);
        });
        clock
    }

    /// Returns the time of the slice in seconds, once it is done.
    pub fn seconds(&self) -> Option<f64> {
        self.seconds.get().copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the work in 40 slices with a budget of 4 ms, in seconds, where a leaf takes 0.1 microseconds, and `clock`
    /// says what is measured. Slices are limited as in `slices.rs`.
    fn work(clock: impl Fn(f64) -> f64, accurate: bool) -> Vec<f64> {
        let (mut pace, mut leaves) = (Pace::default(), 1000);
        let slice = |_| {
            let work = 1e-7 * f64::from(leaves);
            pace.add(leaves, clock(work), accurate);
            leaves = (pace.leaves_within(Duration::from_millis(4)) as u32).clamp(1000, (4 * leaves).min(1_000_000));
            work
        };
        (0..40).map(slice).collect()
    }

    /// Slices do not shrink because frames take time, and do not hold up frames for long.
    #[test]
    fn latency_is_no_work() {
        assert!((work(|work| work, true)[39] - 0.004).abs() < 1e-6);
        for latency in [0.002, 0.016, 0.03] {
            let found = work(|work| latency + work, false)[39];
            assert!((0.0035..0.0045).contains(&found), "{found} after {latency} s");
            // Where ends are noticed once a frame.
            let found = work(|work| latency * (1.0 + (work / latency).floor()), false);
            assert!(found[10..].iter().all(|work| (0.002..2.0 * latency + 0.004).contains(work)), "{found:?}");
        }
        // On a slow GPU, all slices stay small.
        assert!(work(|work| 1000.0 * work, false).iter().all(|work| *work < 1.1e-4));
    }
}
