//! Samples the leaves of a field and renders its views, slice by slice.

use std::{sync::Arc, time::Duration};

use bevy::{
    prelude::*,
    render::{
        render_asset::RenderAssets,
        render_resource::{
            BindGroupEntries, BindGroupLayout, Buffer, BufferUsages, CachedPipelineState, CommandEncoderDescriptor,
            ComputePipeline, MapMode, PipelineCache, SpecializedComputePipelines,
        },
        renderer::{RenderDevice, RenderQueue},
    },
};

use plenoctree::sampling::{Lattice, SamplePoint, ViewRays};

use super::{
    RawSamples, SamplingFailure, SamplingJob, SamplingJobs,
    buffers::{buffer, storage},
    clock::{Pace, SliceClock},
    pipeline::{Sampled, SamplingPipeline, SliceUniform},
    views::Views,
};
use crate::gpu::{Allocator, GpuField, GpuLevel, SAMPLING_WORKGROUP, buffer_with, pipelines::is_loading};

/// The approximate minimum number of rays in a slice, and the number in the first one, before the speed of the GPU is
/// known.
const FEWEST_RAYS: usize = 1 << 16;
/// The approximate maximum number of rays in a slice. Drivers reset a GPU that is busy for two seconds.
const MOST_RAYS: usize = 1 << 22;
/// The number of views in a slice, if there is a budget.
const VIEWS: usize = FEWEST_RAYS / (ViewRays::SIDE * ViewRays::SIDE);
/// The number of words of the lattice that are uploaded in a frame, if there is a budget: 4 MiB.
const MOST_WORDS: usize = 1 << 20;
/// The maximum number of submitted slices that the GPU has not finished.
const MOST_IN_FLIGHT: usize = 2;

/// The job in progress.
#[derive(Resource, Default)]
pub(super) struct ActiveSampling(Option<Active>);

struct Active {
    job: Arc<SamplingJob>,
    /// The GPU time per frame, or `None` for no limit.
    budget: Option<Duration>,
    field: Arc<GpuLevel>,
    layout: BindGroupLayout,
    uniform: SliceUniform,
    allocator: Allocator,
    observers: Buffer,
    bins: Buffer,
    lattice: Buffer,
    views: Option<Views>,
    /// The number of words of the lattice that are uploaded, or `None` if rays follow the records of the octree.
    words: Option<usize>,
    /// The number of leaves in the smallest and in the largest slice.
    fewest: u32,
    most: u32,
    next: u32,
    /// The factor that converts integers in the histograms to weights.
    unit: f64,
    pace: Pace,
    in_flight: Vec<SliceClock>,
    /// The number of leaves in the last slice.
    last_leaves: u32,
    /// Whether all slices are submitted and the samples are being read back.
    reading: bool,
}

/// Starts, advances and ends jobs: one slice per frame, or all slices at once if there is no budget.
pub(super) fn advance_sampling(
    mut active: ResMut<ActiveSampling>,
    jobs: Res<SamplingJobs>,
    fields: Res<RenderAssets<GpuField>>,
    pipeline: Res<SamplingPipeline>,
    mut pipelines: ResMut<SpecializedComputePipelines<SamplingPipeline>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    if active.0.as_ref().is_some_and(|active| !active.job.is_open()) {
        active.0 = None;
    }
    if active.0.is_none() {
        // Fields whose upload is pending are sampled later.
        let waiting = jobs.open.iter().filter(|job| job.is_open());
        let uploaded = |job: &Arc<SamplingJob>| fields.get(job.id).filter(|field| field.outcome().is_some());
        let Some((job, field)) = waiting.filter_map(|job| Some((job, uploaded(job)?))).next() else {
            return;
        };
        match Active::new(job, jobs.budget, field, &pipeline, &cache, &device, &queue) {
            Ok(started) => active.0 = Some(started),
            Err(failure) => return job.end(Err(failure)),
        }
    }
    let Some(current) = &mut active.0 else { return };
    current.budget = jobs.budget;
    let mut find = |sampled| {
        let id = pipelines.specialize(&cache, &pipeline, (current.field.shape, sampled));
        match cache.get_compute_pipeline_state(id) {
            CachedPipelineState::Err(error) if !is_loading(error) => Err(SamplingFailure::Pipeline(error.to_string())),
            _ => Ok(cache.get_compute_pipeline(id)),
        }
    };
    let leaves = find(Sampled::Leaves { lattice: current.words.is_some() });
    let views = current.views.as_ref().map(|_| find(Sampled::Views)).transpose();
    match (leaves, views) {
        (Err(failure), _) | (_, Err(failure)) => current.job.end(Err(failure)),
        // They are being compiled.
        (Ok(None), _) | (_, Ok(Some(None))) => {}
        (Ok(Some(leaves)), Ok(views)) => {
            let views = views.flatten();
            current.advance(leaves, views, &device, &queue).unwrap_or_else(|failure| current.job.end(Err(failure)));
        }
    }
}

impl Active {
    fn new(
        job: &Arc<SamplingJob>,
        budget: Option<Duration>,
        field: &GpuField,
        pipeline: &SamplingPipeline,
        cache: &PipelineCache,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Result<Self, SamplingFailure> {
        let settings = &job.settings.sampling;
        let listed = listed(job, device);
        let field = field.arrived().ok_or(SamplingFailure::TooLarge)?;

        // Leave room for the largest sum. The scale is a power of two, so that scaling is exact.
        let bound = job.weight_bound;
        // It is a number of 32 bits: at most 2^127.
        let exponent = if bound > 0.0 { bound.log2().ceil().max(-65.0) } else { 0.0 };
        let weight_scale = (62.0 - exponent).exp2();
        let uniform = SliceUniform {
            frame_scale: job.field.frame().scale.as_vec3(),
            leaves: 0,
            rays_per_cell: (settings.multisamples * settings.multisamples) as u32,
            fine_bins: settings.fine_bins as u32,
            coarse_bins: settings.coarse_bins as u32,
            limit: (-settings.stop_transmittance.ln()).min(1e30) as f32,
            weight_scale: weight_scale as f32,
            at_entry: u32::from(job.point == SamplePoint::Entry),
            lattice_low: listed.map_or(IVec3::ZERO, |lattice| lattice.low.as_ivec3()),
            lattice_size: listed.map_or(IVec3::ZERO, |lattice| lattice.size.as_ivec3()),
        };

        let mut allocator = Allocator::default();
        let bytes = listed.map_or(4, |lattice| lattice.words.len() as u64 * 4);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let lattice = buffer(&mut allocator, device, "plenoctree_lattice", bytes, usage)?;
        let bytes = 8 * (settings.fine_bins.pow(3) + settings.coarse_bins.pow(3)) as u64;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let bins = buffer(&mut allocator, device, "plenoctree_histograms", bytes, usage)?;
        let observers = bytemuck::cast_slice(&job.observers);
        let observers = storage(&mut allocator, device, queue, "plenoctree_observers", observers)?;
        let layout = cache.get_bind_group_layout(&pipeline.views_layout);
        let most = budget.map_or(usize::MAX, |_| VIEWS);
        let views = Views::new(job, most, &layout, &mut allocator, device, queue)?;
        let share = job.field.leaves() as f64 / job.leaves.len().max(1) as f64;
        job.progress.begin(job.leaves.len());
        Ok(Self {
            job: job.clone(),
            budget,
            field: field.clone(),
            layout: cache.get_bind_group_layout(&pipeline.leaves_layout),
            uniform,
            allocator,
            observers,
            bins,
            lattice,
            views,
            words: listed.map(|_| 0),
            fewest: slice_for(FEWEST_RAYS, job),
            most: slice_for(MOST_RAYS, job),
            next: 0,
            unit: share / weight_scale,
            pace: Pace::default(),
            in_flight: Vec::new(),
            last_leaves: 0,
            reading: false,
        })
    }

    fn leaves(&self) -> u32 {
        self.job.leaves.len() as u32
    }

    /// Submits the slices of this frame.
    fn advance(
        &mut self,
        pipeline: &ComputePipeline,
        views: Option<&ComputePipeline>,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Result<(), SamplingFailure> {
        for clock in &self.in_flight {
            if let Some(seconds) = clock.seconds() {
                self.pace.add(clock.leaves, seconds, clock.is_accurate);
                self.job.progress.advance(clock.leaves as usize);
            }
        }
        self.in_flight.retain(|clock| clock.seconds().is_none());
        if !self.upload_lattice(queue) {
            return Ok(());
        }
        match self.budget {
            None => {
                while self.next < self.leaves() {
                    self.submit(self.most, pipeline, device, queue)?;
                }
                while self.look(views, device, queue) {}
            }
            Some(_) if self.in_flight.len() >= MOST_IN_FLIGHT => {}
            Some(budget) if self.next < self.leaves() => {
                let leaves = self.pace.leaves_within(budget);
                // The measured speed of a small slice is inaccurate, so limit the growth.
                let leaves = (leaves as u32).clamp(self.fewest, self.most).min((4 * self.last_leaves).max(self.fewest));
                self.submit(leaves, pipeline, device, queue)?;
            }
            Some(_) => {
                self.look(views, device, queue);
            }
        }
        let is_done = self.next == self.leaves() && self.views.as_ref().is_none_or(Views::is_done);
        if is_done && !self.reading {
            self.reading = true;
            self.read_back(device, queue)?;
        }
        Ok(())
    }

    /// Uploads the next words of the lattice, or all of them if there is no budget. Returns whether it is complete.
    fn upload_lattice(&mut self, queue: &RenderQueue) -> bool {
        let (Some(uploaded), Some(lattice)) = (&mut self.words, &self.job.lattice) else { return true };
        let rest = &lattice.words[*uploaded..];
        let next = &rest[..rest.len().min(self.budget.map_or(usize::MAX, |_| MOST_WORDS))];
        if !next.is_empty() {
            queue.write_buffer(&self.lattice, 4 * *uploaded as u64, bytemuck::cast_slice(next));
        }
        *uploaded += next.len();
        *uploaded == lattice.words.len()
    }

    fn submit(
        &mut self,
        most: u32,
        pipeline: &ComputePipeline,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Result<(), SamplingFailure> {
        let leaves = most.min(self.leaves() - self.next);
        if leaves == 0 {
            return Ok(());
        }
        let cells = &self.job.leaves[self.next as usize..][..leaves as usize];
        let cells = bytemuck::cast_slice(cells);
        let cells = storage(&mut self.allocator, device, queue, "plenoctree_leaf_cells", cells)?;
        let uniform = SliceUniform { leaves, ..self.uniform };
        let slice = buffer_with(device, queue, "plenoctree_slice", BufferUsages::UNIFORM, &uniform);
        let bind_group = device.create_bind_group(
            "plenoctree_sampling",
            &self.layout,
            &BindGroupEntries::sequential((
                slice.as_entire_buffer_binding(),
                cells.as_entire_buffer_binding(),
                self.observers.as_entire_buffer_binding(),
                self.bins.as_entire_buffer_binding(),
                self.lattice.as_entire_buffer_binding(),
            )),
        );
        let directions = self.job.settings.sampling.direction_cells() as u32;
        let clock = SliceClock::submit("plenoctree_sampling", leaves, self.budget.is_some(), device, queue, |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_group, &[]);
            pass.set_bind_group(1, &self.field.bind_group, &[]);
            pass.dispatch_workgroups(leaves.div_ceil(SAMPLING_WORKGROUP), directions, 1);
        });
        self.next += leaves;
        self.last_leaves = leaves;
        self.in_flight.push(clock);
        Ok(())
    }

    /// Looks at the next slice of views. Returns whether there was one.
    fn look(&mut self, pipeline: Option<&ComputePipeline>, device: &RenderDevice, queue: &RenderQueue) -> bool {
        let Some((views, pipeline)) = self.views.as_mut().zip(pipeline) else { return false };
        let Some((group, [x, y, z])) = views.next() else { return false };
        let clock = SliceClock::submit("plenoctree_views", 0, self.budget.is_some(), device, queue, |pass| {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.set_bind_group(1, &self.field.bind_group, &[]);
            pass.dispatch_workgroups(x, y, z);
        });
        self.in_flight.push(clock);
        true
    }

    /// Reads back the samples, and ends the job with them once the GPU is done.
    fn read_back(&mut self, device: &RenderDevice, queue: &RenderQueue) -> Result<(), SamplingFailure> {
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let (bins, seen) = (self.bins.size(), self.views.as_ref().map_or(0, |views| views.seen.size()));
        let readable = buffer(&mut self.allocator, device, "plenoctree_samples_readback", bins + seen, usage)?;
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(&self.bins, 0, &readable, 0, bins);
        if let Some(views) = &self.views {
            encoder.copy_buffer_to_buffer(&views.seen, 0, &readable, bins, seen);
        }
        queue.submit([encoder.finish()]);
        let (job, buffer, unit) = (self.job.clone(), readable.clone(), self.unit);
        readable.slice(..).map_async(MapMode::Read, move |result| {
            let outcome = result.map_err(|error| SamplingFailure::Readback(error.to_string())).map(|()| RawSamples {
                bytes: buffer.slice(..).get_mapped_range().to_vec(),
                unit,
                count: (job.leaves.len() * job.settings.sampling.direction_cells()) as u64,
                views: job.views.clone(),
            });
            job.end(outcome);
        });
        Ok(())
    }
}

/// Returns the lattice of a job, if it fits in a buffer.
fn listed<'a>(job: &'a SamplingJob, device: &RenderDevice) -> Option<&'a Lattice> {
    let limits = device.limits();
    let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
    job.lattice.as_ref().filter(|lattice| lattice.words.len() as u64 * 4 <= most)
}

/// Returns the number of leaves that have about `rays` rays in total, in whole workgroups. A dispatch can have at most
/// 65535 workgroups along an axis.
fn slice_for(rays: usize, job: &SamplingJob) -> u32 {
    let workgroups = rays / job.observers.len().max(1) / SAMPLING_WORKGROUP as usize;
    workgroups.clamp(1, 65535) as u32 * SAMPLING_WORKGROUP
}
