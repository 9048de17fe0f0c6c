//! Radiance sampling on the GPU, in the render world: section 3 of the method, steps 1 to 5.
//!
//! The leaves are worked through in slices, so that frames keep coming; samples are added to histograms where they are
//! made, and only the histograms come back.

mod clock;
mod job;
mod pipeline;
mod slices;

pub(crate) use job::{SamplingFailure, SamplingJob, SamplingJobs};

use bevy::{
    core_pipeline::schedule::camera_driver,
    prelude::*,
    render::{
        GpuResourceAppExt, RenderApp, RenderStartup, extract_resource::ExtractResourcePlugin,
        render_resource::SpecializedComputePipelines, renderer::RenderGraph,
    },
};

/// Works off [`SamplingJobs`].
pub(crate) struct SamplingPlugin;

impl Plugin for SamplingPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<SamplingJobs>();
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        app.add_plugins(ExtractResourcePlugin::<SamplingJobs>::default());
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            // A lost device takes its slices with it: the job, which is still open, begins anew.
            render_app
                .init_gpu_resource::<slices::ActiveSampling>()
                .init_gpu_resource::<SpecializedComputePipelines<pipeline::SamplingPipeline>>()
                .add_systems(RenderStartup, pipeline::init)
                .add_systems(RenderGraph, slices::advance_sampling.before(camera_driver));
        }
    }
}
