//! The pipelines of the shadow pass.

use bevy::{
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, CompareFunction, FragmentState, RenderPipelineDescriptor,
        ShaderStages, SpecializedRenderPipeline, VertexState,
        binding_types::{storage_buffer_read_only, uniform_buffer},
    },
    shader::{Shader, ShaderDefVal},
};

use crate::{
    gpu::{FieldLayout, Shaders},
    render::{
        attachment::depth_test,
        view::{PropUniform, ViewUniform},
    },
};

#[derive(Resource)]
pub(super) struct ShadowPipeline {
    shader: Handle<Shader>,
    /// The layout of bind group 0: the map and its props.
    pub view: BindGroupLayoutDescriptor,
    field: BindGroupLayoutDescriptor,
}

pub(super) fn init(mut commands: Commands, field: Res<FieldLayout>, shaders: Res<Shaders>) {
    let entries = BindGroupLayoutEntries::sequential(
        ShaderStages::VERTEX_FRAGMENT,
        (uniform_buffer::<ViewUniform>(false), storage_buffer_read_only::<Vec<PropUniform>>(false)),
    );
    commands.insert_resource(ShadowPipeline {
        shader: shaders.shadow.clone(),
        view: BindGroupLayoutDescriptor::new("plenoctree_shadow", &entries),
        field: field.0.clone(),
    });
}

impl SpecializedRenderPipeline for ShadowPipeline {
    /// Whether the field has child records besides the table.
    type Key = bool;

    fn specialize(&self, inner_records: bool) -> RenderPipelineDescriptor {
        let mut definitions: Vec<ShaderDefVal> = vec!["SHADOW_MAP".into()];
        if inner_records {
            definitions.push("INNER_RECORDS".into());
        }
        RenderPipelineDescriptor {
            label: Some("plenoctree_shadow".into()),
            layout: vec![self.view.clone(), self.field.clone()],
            vertex: VertexState {
                shader: self.shader.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: vec![],
            }),
            // Bevy's maps have the format and the order of the scene's depth.
            depth_stencil: Some(depth_test(CORE_3D_DEPTH_FORMAT, true, CompareFunction::Greater)),
            ..default()
        }
    }
}
