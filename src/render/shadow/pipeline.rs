//! The pipelines of the shadow pass.

use bevy::{
    core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT,
    prelude::*,
    render::render_resource::{
        BindGroupLayoutDescriptor, BindGroupLayoutEntries, CompareFunction, DepthStencilState, FragmentState,
        RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline, TextureFormat, TextureSampleType,
        VertexState,
        binding_types::{storage_buffer_read_only, texture_2d, uniform_buffer},
    },
    shader::{Shader, ShaderDefVal},
};

use crate::{
    gpu::{FieldLayouts, Shaders, TreeShape},
    render::uniforms::{PropUniform, ViewUniform},
};

/// The format of tiles: distances along the light's axis, from where the rays of a prop begin. Negative where it is not
/// solid.
pub(super) const TILE_FORMAT: TextureFormat = TextureFormat::R32Float;

#[derive(Resource)]
pub(super) struct ShadowPipeline {
    march: Handle<Shader>,
    copy: Handle<Shader>,
    /// The layout of bind group 0: the map and its props.
    pub view: BindGroupLayoutDescriptor,
    fields: FieldLayouts,
    /// The layout of bind group 1 for copying a tile.
    pub tile: BindGroupLayoutDescriptor,
}

pub(super) fn init(mut commands: Commands, fields: Res<FieldLayouts>, shaders: Res<Shaders>) {
    let entries = BindGroupLayoutEntries::sequential(
        ShaderStages::VERTEX_FRAGMENT,
        (uniform_buffer::<ViewUniform>(false), storage_buffer_read_only::<Vec<PropUniform>>(false)),
    );
    let tile = texture_2d(TextureSampleType::Float { filterable: false });
    commands.insert_resource(ShadowPipeline {
        march: shaders.get("shadow"),
        copy: shaders.get("shadow_tile"),
        view: BindGroupLayoutDescriptor::new("plenoctree_shadow", &entries),
        fields: fields.clone(),
        tile: BindGroupLayoutDescriptor::new(
            "plenoctree_shadow_tile",
            &BindGroupLayoutEntries::single(ShaderStages::FRAGMENT, tile),
        ),
    });
}

/// A way to draw a prop.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum ShadowKey {
    /// Marches rays into the map.
    March(TreeShape),
    /// Marches rays into a tile.
    Fill(TreeShape),
    /// Copies a tile into the map.
    Copy,
}

impl SpecializedRenderPipeline for ShadowPipeline {
    type Key = ShadowKey;

    fn specialize(&self, key: ShadowKey) -> RenderPipelineDescriptor {
        let mut definitions: Vec<ShaderDefVal> = vec!["SHADOW_MAP".into()];
        let is_tile = matches!(key, ShadowKey::Fill(_));
        if is_tile {
            definitions.push("TILE".into());
        }
        let (shader, group) = match key {
            ShadowKey::March(tree) | ShadowKey::Fill(tree) => {
                definitions.extend(tree.definitions());
                (&self.march, self.fields.get())
            }
            ShadowKey::Copy => (&self.copy, &self.tile),
        };
        RenderPipelineDescriptor {
            label: Some("plenoctree_shadow".into()),
            layout: vec![self.view.clone(), group.clone()],
            vertex: VertexState {
                shader: self.march.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                ..default()
            },
            fragment: Some(FragmentState {
                shader: shader.clone(),
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets: if is_tile { vec![Some(TILE_FORMAT.into())] } else { vec![] },
            }),
            // Bevy's maps have the format and the depth order of the scene's depth texture.
            depth_stencil: (!is_tile).then(|| DepthStencilState {
                format: CORE_3D_DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(CompareFunction::Greater),
                stencil: default(),
                bias: default(),
            }),
            ..default()
        }
    }
}
