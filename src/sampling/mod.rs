//! Radiance sampling on the GPU, in the render world. See section 3 of the method, steps 1 to 5.
//!
//! Leaves are sampled in slices, so that the app keeps rendering frames. Samples are added to histograms on the GPU.
//! Only these are read back, and, if the palette needs them, [`views`] of the field. Views come in slices, too.

mod buffers;
mod clock;
mod job;
mod pipeline;
mod slices;
mod views;

pub(crate) use job::{RawSamples, SamplingFailure, SamplingJob, SamplingJobs};

use bevy::{
    core_pipeline::schedule::camera_driver,
    prelude::*,
    render::{
        GpuResourceAppExt, RenderApp, RenderStartup, extract_resource::ExtractResourcePlugin,
        render_resource::SpecializedComputePipelines, renderer::RenderGraph,
    },
};

/// Runs the jobs in [`SamplingJobs`].
pub(crate) struct SamplingPlugin;

impl Plugin for SamplingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<SamplingJobs>();
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        app.add_plugins(ExtractResourcePlugin::<SamplingJobs>::default());
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            // If the device is lost, so are its slices. The job is still open and starts over.
            render_app
                .init_gpu_resource::<slices::ActiveSampling>()
                .init_gpu_resource::<SpecializedComputePipelines<pipeline::SamplingPipeline>>()
                .add_systems(RenderStartup, pipeline::init)
                .add_systems(RenderGraph, slices::advance_sampling.before(camera_driver));
        }
    }
}
