//! What parallel rays see of a field, in compute passes. Palettes of tones are found among these colors.

use bevy::render::{
    render_resource::{BindGroup, BindGroupEntries, BindGroupLayout, Buffer, BufferBinding, BufferSize, BufferUsages},
    renderer::{RenderDevice, RenderQueue},
};
use glam::DVec3;
use plenoctree::{PlenOctree, sampling::ViewRays};

use super::{
    SamplingFailure, SamplingJob,
    buffers::{buffer, storage},
};
use crate::gpu::{Allocator, tree_depth};

/// The side of a workgroup. Matches `see.wgsl`.
const SIDE: usize = 8;
const _: () = assert!(ViewRays::SIDE.is_multiple_of(SIDE));

/// The bytes of what a view sees. A slice of views is bound at a multiple of them, and bindings start at multiples of
/// 256.
const BYTES: usize = 16 * ViewRays::SIDE * ViewRays::SIDE;
const _: () = assert!(BYTES.is_multiple_of(256));

/// The views of a job.
pub(super) struct Views {
    /// What rays see: four numbers each. See `View::from_texels`.
    pub seen: Buffer,
    /// The slices that are not looked at yet, and the number of views in each.
    waiting: Vec<(BindGroup, u32)>,
}

impl Views {
    /// Returns the views of a job, in slices of at most `most`, if its palette needs any.
    pub fn new(
        job: &SamplingJob,
        most: usize,
        layout: &BindGroupLayout,
        allocator: &mut Allocator,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) -> Result<Option<Self>, SamplingFailure> {
        if job.views.is_empty() {
            return Ok(None);
        }
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let seen = buffer(allocator, device, "plenoctree_views", (BYTES * job.views.len()) as u64, usage)?;
        let (mut waiting, mut offset) = (Vec::new(), 0);
        for views in job.views.chunks(most) {
            let rays: Vec<_> = views.iter().map(|rays| in_cells(&job.field, rays)).collect();
            let rays = storage(allocator, device, queue, "plenoctree_view_rays", bytemuck::cast_slice(&rays))?;
            let bytes = (BYTES * views.len()) as u64;
            let seen = BufferBinding { buffer: &seen, offset, size: BufferSize::new(bytes) };
            let entries = BindGroupEntries::sequential((rays.as_entire_binding(), seen));
            waiting.push((device.create_bind_group("plenoctree_views", layout, &entries), views.len() as u32));
            offset += bytes;
        }
        Ok(Some(Self { seen, waiting }))
    }

    /// Returns whether all views have been looked at.
    pub fn is_done(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Takes another slice, if there is one: its bind group, and the numbers of its workgroups.
    pub fn next(&mut self) -> Option<(BindGroup, [u32; 3])> {
        let side = (ViewRays::SIDE / SIDE) as u32;
        self.waiting.pop().map(|(group, views)| (group, [side, side, views]))
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
