//! Measures how long a slice takes on the GPU.

use std::sync::{Arc, OnceLock};

use bevy::{
    platform::time::Instant,
    render::{
        render_resource::{Buffer, BufferDescriptor, BufferUsages, CommandEncoder, MapMode},
        renderer::{RenderDevice, RenderQueue},
    },
};
use wgpu::{ComputePassTimestampWrites, Features, QuerySet, QuerySetDescriptor, QueryType};

/// Measures one submission: with GPU timestamps if it must be accurate and the adapter supports them, otherwise in
/// wall-clock time.
pub(super) struct SliceClock {
    /// The number of leaves in the slice, or 0 if it is one of views.
    pub leaves: u32,
    seconds: Arc<OnceLock<f64>>,
    timestamps: Option<Timestamps>,
}

struct Timestamps {
    queries: QuerySet,
    resolved: Buffer,
    readable: Buffer,
}

impl SliceClock {
    pub fn new(leaves: u32, is_accurate: bool, device: &RenderDevice) -> Self {
        let has_timestamps = device.features().contains(Features::TIMESTAMP_QUERY);
        let timestamps = (is_accurate && has_timestamps).then(|| {
            let buffer = |usage| {
                let label = Some("plenoctree_slice_clock");
                device.create_buffer(&BufferDescriptor { label, size: 16, usage, mapped_at_creation: false })
            };
            Timestamps {
                queries: device.wgpu_device().create_query_set(&QuerySetDescriptor {
                    label: Some("plenoctree_slice_clock"),
                    ty: QueryType::Timestamp,
                    count: 2,
                }),
                resolved: buffer(BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC),
                readable: buffer(BufferUsages::MAP_READ | BufferUsages::COPY_DST),
            }
        });
        Self { leaves, seconds: Arc::default(), timestamps }
    }

    /// Returns the timestamp writes for the slice's compute pass.
    pub fn writes(&self) -> Option<ComputePassTimestampWrites<'_>> {
        self.timestamps.as_ref().map(|timestamps| ComputePassTimestampWrites {
            query_set: &timestamps.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        })
    }

    /// Resolves the timestamps. Call this after the pass, before the encoder is submitted.
    pub fn resolve(&self, encoder: &mut CommandEncoder) {
        if let Some(Timestamps { queries, resolved, readable }) = &self.timestamps {
            encoder.resolve_query_set(queries, 0..2, resolved, 0);
            encoder.copy_buffer_to_buffer(resolved, 0, readable, 0, 16);
        }
    }

    /// Starts the clock. Call this right after the encoder is submitted.
    pub fn start(&self, queue: &RenderQueue) {
        let seconds = self.seconds.clone();
        let start = Instant::now();
        let Some(timestamps) = &self.timestamps else {
            queue.on_submitted_work_done(move || {
                let _ = seconds.set(start.elapsed().as_secs_f64());
            });
            return;
        };
        let nanoseconds = f64::from(queue.get_timestamp_period());
        let readable = timestamps.readable.clone();
        timestamps.readable.slice(..).map_async(MapMode::Read, move |result| {
            // If the device was lost, there is nothing to read, but the slice still has to count as done.
            let ticks = result.ok().map(|()| {
                let mapped = readable.slice(..).get_mapped_range();
                let [begin, end] = [0, 8].map(|at| bytemuck::pod_read_unaligned::<u64>(&mapped[at..at + 8]));
                end.saturating_sub(begin)
            });
            let measured = ticks.map_or_else(|| start.elapsed().as_secs_f64(), |t| t as f64 * nanoseconds * 1e-9);
            let _ = seconds.set(measured);
        });
    }

    /// Returns the time of the slice in seconds, once it is done.
    pub fn seconds(&self) -> Option<f64> {
        self.seconds.get().copied()
    }
}
