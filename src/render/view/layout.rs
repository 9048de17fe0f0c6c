//! The layouts of bind group 0.

use bevy::{
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, ShaderStages,
        binding_types::{
            storage_buffer_read_only, storage_buffer_read_only_sized, texture_depth_2d, texture_depth_2d_multisampled,
            uniform_buffer,
        },
    },
};

use super::uniforms::{PropUniform, ViewUniform};
use crate::render::kept::StaleUniform;

/// The layouts of bind group 0, in three variants.
#[derive(Resource)]
pub(in crate::render) struct ViewLayouts {
    /// With the depth of the scene: single-sampled, then multisampled.
    pub with_depth: [BindGroupLayoutDescriptor; 2],
    /// With the batches in addition.
    pub with_batches: [BindGroupLayoutDescriptor; 2],
    /// Without the depth of the scene.
    pub plain: BindGroupLayoutDescriptor,
}

pub(super) fn init(mut commands: Commands) {
    let shared = || {
        (
            uniform_buffer::<ViewUniform>(false),
            storage_buffer_read_only::<Vec<PropUniform>>(false),
            storage_buffer_read_only::<Vec<Vec4>>(false),
            uniform_buffer::<StaleUniform>(false),
        )
    };
    let stages = ShaderStages::VERTEX_FRAGMENT;
    let with_depth = |depth| {
        let (view, props, colors, stale) = shared();
        let entries = BindGroupLayoutEntries::sequential(stages, (view, props, colors, stale, depth));
        BindGroupLayoutDescriptor::new("plenoctree_view_with_depth", &entries)
    };
    let with_batches = |depth: BindGroupLayoutDescriptor| {
        let buffer = || storage_buffer_read_only_sized(false, None);
        let batches = [(5, buffer()), (6, buffer())].map(|(binding, buffer)| buffer.build(binding, stages));
        let entries: Vec<_> = depth.entries.iter().copied().chain(batches).collect();
        BindGroupLayoutDescriptor::new("plenoctree_view_with_batches", &entries)
    };
    let with_depth = [with_depth(texture_depth_2d()), with_depth(texture_depth_2d_multisampled())];
    commands.insert_resource(ViewLayouts {
        with_batches: with_depth.clone().map(with_batches),
        with_depth,
        plain: BindGroupLayoutDescriptor::new("plenoctree_view", &BindGroupLayoutEntries::sequential(stages, shared())),
    });
}
