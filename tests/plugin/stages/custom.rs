//! Tests custom render stages between the labels and the screen.

use bevy::{
    camera::Viewport,
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
use bevy_plenoctree::{
    BeforePalette, BilateralFilter, EdgeSmoothing, LabelStages, LabelTextures, Palette, PaletteLabel,
    PlenOctreeRenderSystems, Posterize, PosterizeView, PropStage,
};

use super::scene::{COLOR, PALETTE, SIZE, SOLID, Scene, assert_near, at, middle};

/// Draws the label of a pixel in red and its owner in green, in sixteenths.
const SHADER: &str = "
@group(0) @binding(0) var colors: texture_2d<f32>;
@group(0) @binding(1) var labels: texture_2d<u32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let label = textureLoad(labels, vec2<u32>(position.xy), 0).rg;
    let color = textureLoad(colors, vec2<u32>(position.xy), 0);
    return vec4(vec2<f32>(label) / 16.0, 0.0, color.a);
}
";

#[derive(Resource)]
struct Stage {
    shader: Handle<Shader>,
    pipeline: Option<(BindGroupLayoutDescriptor, CachedRenderPipelineId)>,
}

fn init(mut stage: ResMut<Stage>, fullscreen: Res<FullscreenShader>, cache: Res<PipelineCache>) {
    let textures = (texture_2d(TextureSampleType::Float { filterable: false }), texture_2d(TextureSampleType::Uint));
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    let layout = BindGroupLayoutDescriptor::new("test_stage", &entries);
    let target = ColorTargetState { format: LabelTextures::COLOR_FORMAT, blend: None, write_mask: ColorWrites::ALL };
    let pipeline = cache.queue_render_pipeline(RenderPipelineDescriptor {
        layout: vec![layout.clone()],
        vertex: fullscreen.to_vertex_state(),
        fragment: Some(FragmentState { shader: stage.shader.clone(), targets: vec![Some(target)], ..default() }),
        ..default()
    });
    stage.pipeline = Some((layout, pipeline));
}

fn run(view: ViewQuery<&LabelTextures>, stage: Res<Stage>, cache: Res<PipelineCache>, mut ctx: RenderContext) {
    let textures = view.into_inner();
    let Some((layout, id)) = &stage.pipeline else { return };
    let Some(pipeline) = cache.get_render_pipeline(*id) else { return };
    let write = textures.stage_write();
    let group = ctx.render_device().create_bind_group(
        None,
        &cache.get_bind_group_layout(layout),
        &BindGroupEntries::sequential((write.source, &textures.labels)),
    );
    let attachment = RenderPassColorAttachment {
        view: write.destination,
        depth_slice: None,
        resolve_target: None,
        ops: Operations { load: LoadOp::Load, store: StoreOp::Store },
    };
    let mut pass =
        ctx.begin_tracked_render_pass(RenderPassDescriptor { color_attachments: &[Some(attachment)], ..default() });
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
}

fn add_stage(app: &mut App) {
    let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(Shader::from_wgsl(SHADER, "stage.wgsl"));
    let render_app = app.sub_app_mut(RenderApp);
    render_app.insert_resource(Stage { shader, pipeline: None }).add_systems(RenderStartup, init);
    // Add the system at both places in the frame. It does nothing at the one that the camera does not use.
    for place in [PropStage::Scene, PropStage::Display] {
        let at_place = move |view: ViewQuery<&LabelTextures>| view.into_inner().stage == place;
        render_app.add_systems(Core3d, run.run_if(at_place).in_set(PlenOctreeRenderSystems::LabelStages(place)));
    }
}

const HARD: Posterize = Posterize {
    blend_steps: 2,
    softness: 0.0,
    min_opacity: 0.3,
    filter: BilateralFilter { iterations: 1, radius: 2, spatial_sigma: 3.0, range_sigma: 4.25 },
    before_palette: BeforePalette::Hide,
    edges: EdgeSmoothing::Off,
};

fn posterized(mut scene: Scene) -> Scene {
    let prop = scene.prop;
    scene.world().entity_mut(prop).insert(HARD);
    scene
}

/// Returns the color in which the stage draws a label and its owner.
fn marked(label: u32, owner: u32) -> Color {
    Color::srgb(label as f32 / 16.0, owner as f32 / 16.0, 0.0)
}

#[test]
fn a_stage_reads_labels_and_owners_and_writes_the_screen() {
    let mut scene = posterized(Scene::with(SOLID, add_stage));
    let without = scene.capture();
    let encoded = |color: Color| Srgba::from(color).to_f32_array_no_alpha().map(f64::from);
    let palette = Palette::new(PALETTE.map(encoded).to_vec()).unwrap();
    let label = PaletteLabel::nearest(encoded(COLOR).into(), &palette, HARD.blend_steps).unwrap();
    for msaa in [Msaa::Off, Msaa::Sample4] {
        for place in [PropStage::Scene, PropStage::Display] {
            scene.set((msaa, place, LabelStages));
            let frame = scene.capture();
            assert_near(middle(&frame), marked(2 + label.index as u32, 1), 1, &format!("{msaa:?}, {place:?}"));
            assert_eq!(at(&frame, 1, 1), at(&without, 1, 1), "next to the prop");
        }
    }
    scene.set_if(false, LabelStages);
    scene.set((Msaa::Off, PropStage::Scene));
    assert!(scene.capture() == without, "without the stage again");
}

#[test]
fn props_as_trained_and_posterized_views_have_different_labels() {
    let mut scene = Scene::with(SOLID, add_stage);
    scene.set((Msaa::Off, LabelStages));
    assert_near(middle(&scene.capture()), marked(1, 0), 1, "as trained");
    let field = scene.field.clone();
    scene.set((PosterizeView(field), HARD));
    let [red, green, _] = middle(&scene.capture());
    assert!(red >= 2 * 16 - 1 && green == 0, "{red} {green}");
}

/// If no stage is added, `LabelStages` does not change the frame.
#[test]
fn label_stages_alone_change_nothing() {
    let mut scene = posterized(Scene::new(SOLID));
    let corner =
        Viewport { physical_position: UVec2::new(7, 3), physical_size: UVec2::new(SIZE - 11, SIZE - 9), ..default() };
    for viewport in [None, Some(corner)] {
        let camera = scene.camera;
        scene.world().get_mut::<Camera>(camera).unwrap().viewport = viewport;
        for msaa in [Msaa::Off, Msaa::Sample4] {
            scene.set(msaa);
            scene.set_if(false, LabelStages);
            let direct = scene.capture();
            scene.set(LabelStages);
            let staged = scene.capture();
            assert_ne!(middle(&direct), at(&direct, 0, 0), "the prop is visible");
            let far = direct.iter().zip(staged.iter()).filter(|(a, b)| a.abs_diff(**b) > 1).count();
            assert_eq!(far, 0, "{msaa:?}");
        }
    }
}
