//! Reads structs back from shaders: Rust and WGSL must agree on the offsets of their fields.

use bevy::{
    prelude::*,
    render::{
        RenderApp,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BindingResource, BufferDescriptor,
            BufferUsages, CachedPipelineState, CommandEncoderDescriptor, ComputePassDescriptor,
            ComputePipelineDescriptor, MapMode, PipelineCache, PollType, ShaderStages,
            binding_types::storage_buffer_sized,
        },
        renderer::{RenderDevice, RenderQueue},
    },
    shader::Shader,
};

use crate::{PlenOctreePlugin, headless::Headless};

/// Runs a compute shader with the entry point `read`, which fills `found: array<f32>` at binding 0 of group 1. `bind`
/// gives the entries of group 0.
pub(crate) fn read_back<const N: usize>(
    shader: String,
    layout: BindGroupLayoutDescriptor,
    bind: impl FnOnce(&RenderDevice, &RenderQueue, &mut dyn FnMut(&[BindingResource])),
) -> [f32; N] {
    let mut headless = Headless::new(UVec2::ONE, |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let shader =
        headless.app.world_mut().resource_mut::<Assets<Shader>>().add(Shader::from_wgsl(shader, "layout.wgsl"));
    let output = BindGroupLayoutDescriptor::new(
        "found",
        &BindGroupLayoutEntries::single(ShaderStages::COMPUTE, storage_buffer_sized(false, None)),
    );
    let id = headless.app.sub_app(RenderApp).world().resource::<PipelineCache>().queue_compute_pipeline(
        ComputePipelineDescriptor {
            layout: vec![layout.clone(), output.clone()],
            shader,
            entry_point: Some("read".into()),
            ..default()
        },
    );
    for _ in 0..100 {
        headless.update();
        let cache = headless.app.sub_app(RenderApp).world().resource::<PipelineCache>();
        if let CachedPipelineState::Err(error) = cache.get_compute_pipeline_state(id) {
            panic!("{error}");
        }
    }
    let world = headless.app.sub_app(RenderApp).world();
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let cache = world.resource::<PipelineCache>();
    let pipeline = cache.get_compute_pipeline(id).expect("a pipeline within a hundred frames");
    let size = 4 * N as u64;
    let buffer =
        |usage| device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
    let found = buffer(BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let readable = buffer(BufferUsages::MAP_READ | BufferUsages::COPY_DST);
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    bind(device, queue, &mut |resources| {
        let entries: Vec<_> = (0u32..)
            .zip(resources)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
            .collect();
        let input = device.create_bind_group(None, &cache.get_bind_group_layout(&layout), &entries);
        let output = device.create_bind_group(
            None,
            &cache.get_bind_group_layout(&output),
            &BindGroupEntries::single(found.as_entire_binding()),
        );
        let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &input, &[]);
        pass.set_bind_group(1, &output, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    });
    encoder.copy_buffer_to_buffer(&found, 0, &readable, 0, size);
    queue.submit([encoder.finish()]);
    readable.slice(..).map_async(MapMode::Read, |result| result.unwrap());
    device.poll(PollType::wait_indefinitely()).unwrap();
    let mapped = readable.slice(..).get_mapped_range();
    let numbers: &[f32] = bytemuck::cast_slice(&mapped);
    numbers.try_into().unwrap()
}

/// 1, 2, 3, ...: a distinct value for every number of a struct.
pub(crate) fn counting() -> impl FnMut() -> f32 {
    let mut last = 0.0;
    move || {
        last += 1.0;
        last
    }
}
