//! What parallel rays see of a field, in a compute pass. Palettes of tones are found among these colors.

use std::sync::Arc;

use bevy::render::{
    render_resource::{
        BindGroup, BindGroupEntries, BindGroupLayout, Buffer, BufferUsages, CommandEncoder, ComputePassDescriptor,
        ComputePipeline,
    },
    renderer::{RenderDevice, RenderQueue},
};
use glam::DVec3;
use plenoctree::{PlenOctree, sampling::ViewRays};

use super::{
    SamplingFailure, SamplingJob,
    buffers::{buffer, storage},
};
use crate::gpu::{Allocator, GpuLevel, tree_depth};

/// The side of a workgroup. Matches `see.wgsl`.
const SIDE: usize = 8;
const _: () = assert!(ViewRays::SIDE.is_multiple_of(SIDE));

/// The views of a job.
pub(super) struct Views {
    /// What rays see: four numbers each. See `View::from_texels`.
    pub seen: Buffer,
    group: BindGroup,
    count: u32,
}

impl Views {
    /// Returns the views of a job, if its palette needs any.
    pub fn new(
        job: &SamplingJob,
        layout: &BindGroupLayout,
        allocator: &mut Allocator,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Result<Option<Self>, SamplingFailure> {
        if job.views.is_empty() {
            return Ok(None);
        }
        let rays: Vec<_> = job.views.iter().map(|rays| in_cells(&job.field, rays)).collect();
        let rays = storage(allocator, device, queue, "plenoctree_view_rays", bytemuck::cast_slice(&rays))?;
        let bytes = (16 * job.views.len() * ViewRays::SIDE * ViewRays::SIDE) as u64;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let seen = buffer(allocator, device, "plenoctree_views", bytes, usage)?;
        let entries = BindGroupEntries::sequential((rays.as_entire_binding(), seen.as_entire_binding()));
        let group = device.create_bind_group("plenoctree_views", layout, &entries);
        Ok(Some(Self { seen, group, count: job.views.len() as u32 }))
    }

    /// Looks along all rays.
    pub fn record(&self, encoder: &mut CommandEncoder, pipeline: &ComputePipeline, field: &Arc<GpuLevel>) {
        let descriptor = ComputePassDescriptor { label: Some("plenoctree_views"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(1, &field.bind_group, &[]);
        let side = (ViewRays::SIDE / SIDE) as u32;
        pass.dispatch_workgroups(side, side, self.count);
    }
}

/// Returns the rays of a view in finest cells, as `Rays` in `see.wgsl` has them.
fn in_cells(field: &PlenOctree, rays: &ViewRays) -> [[f32; 4]; 5] {
    let cells = f64::from(1u32 << tree_depth(field));
    let per_unit = field.frame().scale * cells;
    let first = field.frame().to_tree(rays.first) * cells;
    let (right, down, direction) = (rays.right * per_unit, rays.down * per_unit, rays.direction * per_unit);
    [first, right, down, direction, rays.direction].map(|v: DVec3| v.as_vec3().extend(0.0).to_array())
}
