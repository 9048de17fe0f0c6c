//! Tests temporal jitter, motion vectors and the depth of the prepass, and the effects that work with them: temporal
//! antialiasing and motion blur. A prop is to look to them like a mesh of the same shape.

use bevy::{
    core_pipeline::{
        Core3d, Core3dSystems, FullscreenShader,
        prepass::{DepthPrepass, MotionVectorPrepass, ViewPrepassTextures},
    },
    diagnostic::FrameCount,
    post_process::motion_blur::MotionBlur,
    prelude::*,
    render::{
        RenderApp, RenderStartup,
        camera::TemporalJitter,
        render_resource::{
            BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, CachedRenderPipelineId,
            ColorTargetState, ColorWrites, FragmentState, LoadOp, PipelineCache, RenderPassDescriptor,
            RenderPipelineDescriptor, ShaderStages, TextureFormat, TextureSampleType,
            binding_types::{texture_2d, texture_depth_2d},
        },
        renderer::{RenderContext, ViewQuery},
        view::ViewTarget,
    },
};
use bevy_anti_alias::{AntiAliasPlugin, taa::TemporalAntiAliasing};
use bevy_plenoctree::{PropPlacement, PropQuality, headless::LitMeshPlugins};
use image::RgbaImage;

use crate::stage::{
    Stage,
    pixels::differing,
    sides::{GREEN, SOLID, color, cube, flat},
    unlit,
};

const SIZE: u32 = 64;

/// Draws motion in red and green, from -1/8 to 1/8 of the viewport, and depth in blue.
const SHADER: &str = "
@group(0) @binding(0) var motion: texture_2d<f32>;
@group(0) @binding(1) var depth: texture_depth_2d;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    return vec4(textureLoad(motion, pixel, 0).rg * 4.0 + 0.5, sqrt(textureLoad(depth, pixel, 0)), 1.0);
}
";

#[derive(Resource)]
struct Show {
    shader: Handle<Shader>,
    pipeline: Option<(BindGroupLayoutDescriptor, CachedRenderPipelineId)>,
}

fn init(mut show: ResMut<Show>, fullscreen: Res<FullscreenShader>, cache: Res<PipelineCache>) {
    let textures = (texture_2d(TextureSampleType::Float { filterable: false }), texture_depth_2d());
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::FRAGMENT, textures);
    let layout = BindGroupLayoutDescriptor::new("test_motion", &entries);
    let format = TextureFormat::Rgba8UnormSrgb;
    let target = ColorTargetState { format, blend: None, write_mask: ColorWrites::ALL };
    let pipeline = cache.queue_render_pipeline(RenderPipelineDescriptor {
        layout: vec![layout.clone()],
        vertex: fullscreen.to_vertex_state(),
        fragment: Some(FragmentState { shader: show.shader.clone(), targets: vec![Some(target)], ..default() }),
        ..default()
    });
    show.pipeline = Some((layout, pipeline));
}

fn run(
    view: ViewQuery<(&ViewTarget, &ViewPrepassTextures)>,
    show: Res<Show>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (target, prepass) = view.into_inner();
    let Some((layout, id)) = &show.pipeline else { return };
    let (Some(pipeline), Some(motion), Some(depth)) =
        (cache.get_render_pipeline(*id), prepass.motion_vectors_view(), prepass.depth_view())
    else {
        return;
    };
    let layout = cache.get_bind_group_layout(layout);
    let group = ctx.render_device().create_bind_group(None, &layout, &BindGroupEntries::sequential((motion, depth)));
    let mut attachment = target.get_color_attachment();
    attachment.ops.load = LoadOp::Clear(default());
    let mut pass =
        ctx.begin_tracked_render_pass(RenderPassDescriptor { color_attachments: &[Some(attachment)], ..default() });
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.draw(0..3, 0..1);
}

/// A cube, as a prop or as a mesh, and a camera. Frames show motion and depth, or colors.
pub struct View {
    pub stage: Stage,
    cube: Entity,
}

impl View {
    pub fn new(is_prop: bool, shows_motion: bool) -> Self {
        let mut stage = Stage::with(UVec2::splat(SIZE), |app| {
            app.add_plugins((LitMeshPlugins, AntiAliasPlugin));
            if shows_motion {
                let shader = Shader::from_wgsl(SHADER, "motion.wgsl");
                let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(shader);
                let render_app = app.sub_app_mut(RenderApp);
                render_app.insert_resource(Show { shader, pipeline: None }).add_systems(RenderStartup, init);
                render_app.add_systems(Core3d, run.in_set(Core3dSystems::EarlyPostProcess));
            }
        });
        let cube = if is_prop {
            stage.spawn_prop(&cube(SOLID, GREEN), ())
        } else {
            stage.spawn_mesh(Cuboid::from_length(1.0), unlit(color(GREEN)), default())
        };
        stage.set((DepthPrepass, MotionVectorPrepass));
        stage.wait();
        Self { stage, cube }
    }

    /// Places the cube and the camera, and returns the next frame.
    pub fn capture(&mut self, cube: Transform, camera: Transform) -> RgbaImage {
        self.stage.insert(self.cube, cube);
        self.stage.set(camera);
        self.stage.capture()
    }
}

#[test]
fn props_move_like_meshes() {
    let [mut prop, mut mesh] = [true, false].map(|is_prop| View::new(is_prop, true));
    let place = |x: f32, turn: f32| Transform::from_xyz(x, 0.1, 0.0).with_rotation(Quat::from_rotation_y(turn));
    let eye = |x: f32, z: f32| Transform::from_xyz(x, 0.3, z).looking_at(Vec3::ZERO, Vec3::Y);
    let still = (place(0.0, 0.2), eye(0.0, 3.0));
    for (what, before, after) in [
        ("still", still, still),
        ("the prop moves", still, (place(0.1, 0.2), still.1)),
        ("the prop turns and grows", still, (place(0.0, 0.4).with_scale(Vec3::splat(1.1)), still.1)),
        ("the camera moves", still, (still.0, eye(0.2, 2.8))),
        ("both move", still, (place(-0.1, 0.3), eye(0.1, 3.1))),
    ] {
        for (jitter, error, projection) in [
            (Vec2::ZERO, 0.0, Projection::default()),
            (Vec2::new(0.4, -0.3), 0.0, Projection::default()),
            (Vec2::ZERO, 0.0, flat()),
            (Vec2::new(0.4, -0.3), 0.1, Projection::default()),
        ] {
            let quality = PropQuality { ray_tolerance: error, ..PropQuality::EXACT };
            let [prop, mesh] = [&mut prop, &mut mesh].map(|view| {
                view.stage.set((TemporalJitter { offset: jitter }, quality, projection.clone()));
                view.capture(before.0, before.1);
                view.capture(before.0, before.1);
                view.capture(after.0, after.1)
            });
            let what = format!("{what}, jitter {jitter}, error {error}");
            let drawn = mesh.pixels().filter(|pixel| pixel[2] > 100).count();
            assert!(drawn > 100, "{what}: {drawn} pixels");
            if after != before {
                let moving = mesh.pixels().filter(|pixel| pixel[0].abs_diff(188) + pixel[1].abs_diff(188) > 4).count();
                assert!(moving > 60, "{what}: {moving} pixels move");
            }
            // Outlines of meshes are rasterized with less precision than rays. Between rays, motion is interpolated.
            let tolerance = if error > 0.0 { 6 } else { 3 };
            let wrong = differing(&prop, &mesh, tolerance);
            assert!(wrong <= drawn / 50, "{what}: {wrong} of {drawn} pixels differ");
        }
    }
}

/// Jitter moves outlines by parts of a pixel. No outline is close to the middle of a pixel.
#[test]
fn props_are_jittered_like_meshes() {
    const OFFSETS: [Vec2; 4] = [Vec2::ZERO, Vec2::new(0.45, 0.0), Vec2::new(-0.45, 0.4), Vec2::new(0.05, -0.45)];
    let [mut prop, mut mesh] = [true, false].map(|is_prop| View::new(is_prop, false));
    let (place, eye) = (Transform::from_xyz(0.0375, 0.0, 0.0), Transform::from_xyz(0.0, 0.0, 3.0));
    for projection in [Projection::default(), flat()] {
        let mut frames = Vec::new();
        for offset in OFFSETS {
            let [prop, mesh] = [&mut prop, &mut mesh].map(|view| {
                view.stage.set((TemporalJitter { offset }, projection.clone()));
                view.capture(place, eye)
            });
            assert_eq!(differing(&prop, &mesh, 2), 0, "jitter {offset}, {projection:?}");
            frames.push(mesh);
        }
        assert!(frames[1..].iter().any(|frame| *frame != frames[0]), "jitter changes nothing");
    }
    // After the effects that jitter is for, it would make props tremble.
    let frames = OFFSETS.map(|offset| {
        prop.stage.set((TemporalJitter { offset }, PropPlacement::Display));
        prop.capture(place, eye)
    });
    assert!(frames.iter().all(|frame| *frame == frames[0]), "jitter moves what is drawn at the display");
}

/// With Bevy's own effects, a prop that moves has the edges of a mesh, and leaves no ghosts that a mesh does not leave.
#[test]
fn props_are_smoothed_and_blurred_like_meshes() {
    let [mut prop, mut mesh] = [true, false].map(|is_prop| View::new(is_prop, false));
    let place = |x: f32, turn: f32| Transform::from_xyz(x, 0.1, 0.0).with_rotation(Quat::from_rotation_y(turn));
    let eye = |x: f32, z: f32| Transform::from_xyz(x, 0.3, z).looking_at(Vec3::ZERO, Vec3::Y);
    let moves: [(&str, &dyn Fn(f32) -> (Transform, Transform)); 4] = [
        ("still", &|_| (place(0.0, 0.2), eye(0.0, 3.0))),
        ("the prop moves", &|step| (place(0.06 * step - 0.4, 0.2 + 0.05 * step), eye(0.0, 3.0))),
        ("the camera moves", &|step| (place(0.0, 0.2), eye(0.08 * step - 0.6, 3.0))),
        ("both move", &|step| (place(0.06 * step - 0.4, 0.2), eye(0.08 * step, 3.0 - 0.03 * step))),
    ];
    for has_blur in [false, true] {
        for (what, at) in moves {
            let frames = [&mut prop, &mut mesh].map(|view| {
                // Jitter follows the count of frames.
                view.stage.world().insert_resource(FrameCount(0));
                view.stage.set((Projection::default(), Msaa::Off, TemporalAntiAliasing::default()));
                view.stage.set_if(has_blur, MotionBlur { shutter_angle: 0.7, samples: 3 });
                let mut last = None;
                for step in 0..10u8 {
                    let (cube, eye) = at(step.into());
                    last = Some(view.capture(cube, eye));
                }
                last.unwrap()
            });
            let [prop, mesh] = &frames;
            let is_between = |pixel: &&image::Rgba<u8>| (10..140).contains(&pixel[1]);
            let edges = mesh.pixels().filter(is_between).count();
            let wrong = differing(prop, mesh, 8);
            assert!(edges > 40 && wrong <= 4, "{what}, blur {has_blur}: {wrong} pixels differ, {edges} are at edges");
        }
    }
}
