//! Adds a custom render stage between the labels and the screen, which draws ink lines where the label changes.
//!
//! ```sh
//! cargo run --release --example custom_stage
//! ```

use bevy::{
    core_pipeline::{FullscreenShader, schedule::Core3d},
    prelude::*,
    render::{
        RenderApp, RenderStartup,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedRenderPipelineId,
            ColorTargetState, ColorWrites, FragmentState, LoadOp, Operations, PipelineCache, RenderPassColorAttachment,
            RenderPassDescriptor, RenderPipelineDescriptor, ShaderStages, StoreOp, TextureSampleType,
            binding_types::texture_2d,
        },
        renderer::{RenderContext, ViewQuery},
    },
};
use bevy_plenoctree::{LabelStages, LabelTextures, PlenOctreeRenderSystems, prelude::*};

fn main() {
    App::new()
        .add_plugins((DefaultPlugins, PlenOctreePlugin, InkPlugin))
        .add_systems(Startup, setup)
        .add_systems(Update, rotate)
        .run();
}

fn setup(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize { softness: 0.0, ..default() }));
    // `LabelStages` makes the plugin write labels to textures, which custom stages can change before they are drawn to
    // the screen.
    commands.spawn((
        Camera3d::default(),
        LabelStages,
        Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y),
    ));
}

fn rotate(time: Res<Time>, mut props: Query<&mut Transform, With<Prop>>) {
    for mut transform in &mut props {
        transform.rotate_y(0.3 * time.delta_secs());
    }
}

/// Draws ink lines between labels.
struct InkPlugin;

impl Plugin for InkPlugin {
    fn build(&self, app: &mut App) {
        let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(Shader::from_wgsl(INK, "ink.wgsl"));
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app
                .insert_resource(InkShader(shader))
                .add_systems(RenderStartup, init_pipeline)
                // Cameras with the default `PropStage` draw their props in this set.
                .add_systems(Core3d, ink_pass.in_set(PlenOctreeRenderSystems::LabelStages(PropStage::Scene)));
        }
    }
}

#[derive(Resource)]
struct InkShader(Handle<Shader>);

#[derive(Resource)]
struct InkPipeline {
    layout: BindGroupLayoutDescriptor,
    id: CachedRenderPipelineId,
}

fn init_pipeline(
    mut commands: Commands,
    shader: Res<InkShader>,
    fullscreen: Res<FullscreenShader>,
    cache: Res<PipelineCache>,
) {
    let layout = BindGroupLayoutDescriptor::new(
        "ink",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (texture_2d(TextureSampleType::Float { filterable: false }), texture_2d(TextureSampleType::Uint)),
        ),
    );
    let id = cache.queue_render_pipeline(RenderPipelineDescriptor {
        label: Some("ink".into()),
        layout: vec![layout.clone()],
        vertex: fullscreen.to_vertex_state(),
        fragment: Some(FragmentState {
            shader: shader.0.clone(),
            targets: vec![Some(ColorTargetState {
                format: LabelTextures::COLOR_FORMAT,
                blend: None,
                write_mask: ColorWrites::ALL,
            })],
            ..default()
        }),
        ..default()
    });
    commands.insert_resource(InkPipeline { layout, id });
}

fn ink_pass(
    view: ViewQuery<&LabelTextures>,
    pipeline: Res<InkPipeline>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let textures = view.into_inner();
    let Some(ink) = cache.get_render_pipeline(pipeline.id).filter(|_| textures.stage == PropStage::Scene) else {
        return;
    };
    let colors = textures.stage_write();
    let group = ctx.render_device().create_bind_group(
        "ink",
        &cache.get_bind_group_layout(&pipeline.layout),
        &BindGroupEntries::sequential((colors.source, &textures.labels)),
    );
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("ink"),
        color_attachments: &[Some(RenderPassColorAttachment {
            view: colors.destination,
            depth_slice: None,
            resolve_target: None,
            ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
        })],
        ..default()
    });
    let (corner, size) = (textures.rect.min, textures.rect.size());
    pass.set_scissor_rect(corner.x, corner.y, size.x, size.y);
    pass.set_render_pipeline(ink);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
}

/// Colors a pixel with ink if it is posterized and the label two pixels to the right or below is a different one.
const INK: &str = "
@group(0) @binding(0) var colors: texture_2d<f32>;
@group(0) @binding(1) var labels: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<i32>(position.xy);
    let last = vec2<i32>(textureDimensions(labels)) - 1;
    let here = textureLoad(labels, pixel, 0).r;
    let right = textureLoad(labels, min(pixel + vec2(2, 0), last), 0).r;
    let below = textureLoad(labels, min(pixel + vec2(0, 2), last), 0).r;
    let color = textureLoad(colors, pixel, 0);
    let is_ink = here > 1u && (here != right || here != below);
    return select(color, vec4(0.07, 0.05, 0.1, color.a), is_ink);
}
";
