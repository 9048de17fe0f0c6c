//! The pipelines of the lighting pass.

use bevy::{
    pbr::GpuLights,
    prelude::*,
    render::{
        globals::GlobalsUniform,
        render_resource::{
            BindGroupLayoutDescriptor, BindGroupLayoutEntries, FragmentState, RenderPipelineDescriptor,
            SamplerBindingType, ShaderStages, ShaderType, SpecializedRenderPipeline, TextureFormat, TextureSampleType,
            VertexState,
            binding_types::{
                sampler, storage_buffer_read_only, storage_buffer_read_only_sized, texture_2d, texture_2d_array,
                texture_cube_array, texture_depth_2d, uniform_buffer,
            },
        },
        view::ViewUniform,
    },
    shader::{Shader, ShaderDefVal},
};

use crate::{
    gpu::Shaders,
    render::fullscreen::{props_test, target},
};

/// The color of the light that arrives, and the fraction that is blocked.
pub(super) const LIGHT_FORMAT: TextureFormat = TextureFormat::Rgba8Unorm;

/// Matches `Lit` in `shade.wgsl`.
#[derive(ShaderType, Clone, Copy, Default)]
pub(super) struct LitUniform {
    pub box_from_world: Mat4,
    pub shadows: f32,
    pub tint: f32,
    pub bands: u32,
    pub self_shadow_distance: f32,
}

#[derive(Resource)]
pub(super) struct LightingPipeline {
    shader: Handle<Shader>,
    /// The layout of bind group 0: what `bevy_pbr::shadows` reads of Bevy's mesh view, at the same places.
    pub lights: BindGroupLayoutDescriptor,
    /// The layout of bind group 1: the lit props, and the depth and the owners of pixels.
    pub props: BindGroupLayoutDescriptor,
}

pub(super) fn init(mut commands: Commands, shaders: Res<Shaders>) {
    let lights = BindGroupLayoutEntries::with_indices(
        ShaderStages::FRAGMENT,
        (
            (0, uniform_buffer::<ViewUniform>(true)),
            (1, uniform_buffer::<GpuLights>(true)),
            (2, texture_cube_array(TextureSampleType::Depth)),
            (3, sampler(SamplerBindingType::Comparison)),
            (5, texture_2d_array(TextureSampleType::Depth)),
            (6, sampler(SamplerBindingType::Comparison)),
            (8, storage_buffer_read_only_sized(false, None)),
            (9, storage_buffer_read_only_sized(false, None)),
            (10, storage_buffer_read_only_sized(false, None)),
            (11, uniform_buffer::<GlobalsUniform>(false)),
        ),
    );
    let props = BindGroupLayoutEntries::sequential(
        ShaderStages::FRAGMENT,
        (
            storage_buffer_read_only::<Vec<LitUniform>>(false),
            texture_depth_2d(),
            texture_2d(TextureSampleType::Float { filterable: false }),
        ),
    );
    commands.insert_resource(LightingPipeline {
        shader: shaders.lighting.clone(),
        lights: BindGroupLayoutDescriptor::new("plenoctree_lights", &lights),
        props: BindGroupLayoutDescriptor::new("plenoctree_lighting", &props),
    });
}

/// What a pipeline is compiled for.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct LightingKey {
    /// Whether the camera's shadows have hard edges.
    pub is_hard: bool,
    /// Whether there are point or spot lights. Software Vulkan computes them even if there are none.
    pub lamps: bool,
}

impl SpecializedRenderPipeline for LightingPipeline {
    type Key = LightingKey;

    fn specialize(&self, LightingKey { is_hard, lamps }: LightingKey) -> RenderPipelineDescriptor {
        // Temporal filtering is not supported: noise that changes from frame to frame would make the edges of bands
        // flicker.
        let filter = if is_hard { "SHADOW_FILTER_METHOD_HARDWARE_2X2" } else { "SHADOW_FILTER_METHOD_GAUSSIAN" };
        let mut definitions = vec![ShaderDefVal::from(filter)];
        if lamps {
            definitions.push("LAMPS".into());
        }
        RenderPipelineDescriptor {
            label: Some("plenoctree_lighting".into()),
            layout: vec![self.lights.clone(), self.props.clone()],
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
                targets: vec![Some(target(LIGHT_FORMAT, None))],
            }),
            depth_stencil: Some(props_test()),
            ..default()
        }
    }
}
