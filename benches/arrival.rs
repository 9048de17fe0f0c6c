//! Prints the times of frames while fields arrive, are shown, swapped and dropped: `cargo bench --bench arrival --
//! [FIELD]`. Without an argument, the field is a generated shell of 0.9 million leaves.
//!
//! The scene is a posterized toadstool, seen with the preset `Fast`. Each step is compared with the median frame of the
//! second before it. A frame ends when the GPU has drawn it. Pipelines are compiled in the background, as in a game.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use bevy::{
    camera::RenderTarget,
    prelude::*,
    render::{
        RenderApp, RenderPlugin,
        render_resource::{PollType, TextureFormat},
        renderer::RenderDevice,
    },
};
use bevy_plenoctree::{
    Activation, PaletteExtraction, PaletteSampler, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropState,
    QualityPreset, UpAxis,
    headless::{HeadlessPlugins, exact_camera},
};
use cpu_time::ProcessTime;
use glam::{DVec3, UVec3};
use half::f16;
use plenoctree::{Basis, Cell, Frame};

const SIZE: u32 = 256;

/// Creates a shell around the origin with a radius of 1, so many finest cells thick.
fn shell(depth: u32, radius: f64, thickness: f64) -> PlenOctree {
    let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
    grow(&mut nodes, &mut leaves, (radius, thickness, f64::from(1u32 << (depth - 1))), UVec3::ZERO, 1 << depth);
    let coefficients = leaves.iter().flat_map(|at: &DVec3| {
        (0..27).map(move |index| f16::from_f64((7.0 * at[index / 9] + index as f64).sin() / (1 + index % 9) as f64))
    });
    let half = DVec3::splat(f64::from(1u32 << (depth - 1)) / radius);
    let (frame, coefficients) = (Frame::spanning(-half, half), coefficients.collect());
    let density = vec![40.0; leaves.len()];
    PlenOctree::new(frame, Basis::Sh9, Activation::Sigmoid, UpAxis::Z, nodes, density, coefficients).unwrap()
}

fn grow(nodes: &mut Vec<[Cell; 8]>, leaves: &mut Vec<DVec3>, shell: (f64, f64, f64), corner: UVec3, size: u32) -> u32 {
    let ((radius, thickness, middle), node, half) = (shell, nodes.len(), size / 2);
    nodes.push([Cell::EMPTY; 8]);
    for index in 0..8 {
        let corner = corner + half * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
        let center = corner.as_dvec3() + 0.5 * f64::from(half) - middle;
        let slack = if half == 1 { 0.0 } else { 0.87 * f64::from(half) };
        if (center.length() - radius).abs() <= 0.5 * thickness + slack {
            nodes[node][index as usize] = if half == 1 {
                leaves.push(center / radius);
                Cell::leaf(leaves.len() as u32 - 1)
            } else {
                Cell::node(grow(nodes, leaves, shell, corner, half))
            };
        }
    }
    node as u32
}

struct Scene {
    app: App,
    prop: Entity,
    frames: Vec<[f64; 2]>,
}

impl Scene {
    /// Runs a frame, and returns its wall time, and the CPU time of all threads meanwhile, in milliseconds.
    fn frame(&mut self) -> [f64; 2] {
        let start = (Instant::now(), ProcessTime::now());
        self.app.update();
        let device = self.app.sub_app(RenderApp).world().resource::<RenderDevice>().clone();
        device.poll(PollType::wait_indefinitely()).unwrap();
        [start.0.elapsed(), start.1.elapsed()].map(|time| 1e3 * time.as_secs_f64())
    }

    /// Makes a change, and runs frames for a second, and then until nothing is waited for.
    fn step(&mut self, what: &str, change: impl FnOnce(&mut World, Entity)) {
        let before = [0, 1].map(|which| median(self.frames.iter().map(|frame| frame[which]).collect()));
        let start = Instant::now();
        change(self.app.world_mut(), self.prop);
        let changing = 1e3 * start.elapsed().as_secs_f64();
        let (mut times, mut arrived) = (Vec::new(), None);
        while arrived.is_none_or(|arrived| start.elapsed() < arrived + Duration::from_secs(1)) {
            times.push(self.frame());
            if !self.app.world().get::<PropState>(self.prop).is_some_and(PropState::is_waiting) {
                arrived = arrived.or(Some(start.elapsed()));
            }
        }
        let worst = [0, 1].map(|which| times.iter().map(|time| time[which]).fold(0.0, f64::max));
        let over = times.iter().filter(|time| time[0] > 1.5 * before[0]).count();
        println!(
            "| {what} | {:.2} s | {} | {:.1} | {:.1} | {:.2} | {over} | {:.1} | {:.1} | {changing:.2} |",
            arrived.unwrap_or_default().as_secs_f64(),
            times.len(),
            before[0],
            worst[0],
            worst[0] / before[0],
            before[1],
            worst[1],
        );
        // The second before the next step.
        let mut left = 1e3;
        let second = times.iter().rev().take_while(|time| {
            left -= time[0];
            left > 0.0
        });
        self.frames = second.copied().collect();
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(0.0)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let file = std::env::args_os().skip(1).find(|argument| argument != "--bench").map(PathBuf::from);
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut app = App::new();
    let render = RenderPlugin { synchronous_pipeline_compilation: false, ..default() };
    let assets = AssetPlugin {
        file_path: root.join("assets").display().to_string(),
        unapproved_path_mode: bevy::asset::UnapprovedPathMode::Allow,
        ..default()
    };
    app.add_plugins((HeadlessPlugins.set(render).set(assets), PlenOctreePlugin));
    app.world_mut().resource_mut::<PaletteExtraction>().sampler = PaletteSampler::Cpu;
    app.finish();
    app.cleanup();
    let image = Image::new_target_texture(SIZE, SIZE, TextureFormat::Rgba8UnormSrgb, None);
    let target = RenderTarget::Image(app.world_mut().resource_mut::<Assets<Image>>().add(image).into());
    let view = Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y);
    let toadstool = app.world().resource::<AssetServer>().load::<PlenOctree>("toadstool.npz");
    let world = app.world_mut();
    world.spawn((exact_camera(Color::WHITE), target, view, QualityPreset::Fast.quality()));
    let prop = world.spawn((Prop(toadstool.clone()), Posterize::default())).id();
    let mut scene = Scene { app, prop, frames: Vec::new() };

    let small = shell(8, 100.0, 7.4);
    let large = shell(9, 210.0, 10.0);
    println!("leaves: {} and {}\n", small.leaves(), large.leaves());
    println!(
        "| step | until drawn | frames | median before, ms | worst | ratio | over 1.5 | CPU time before, ms | worst | the \
         change itself, ms |\n|---|---|---|---|---|---|---|---|---|---|"
    );
    scene.step("start", |_, _| ());
    scene.step("nothing", |_, _| ());
    let name = |file: &PathBuf| file.display().to_string();
    scene.step("0.9 million leaves instead, extracting their palette", |world, prop| {
        let field = match &file {
            Some(file) => world.resource::<AssetServer>().load(name(file)),
            None => world.resource_mut::<Assets<PlenOctree>>().add(small.clone()),
        };
        world.get_mut::<Prop>(prop).unwrap().0 = field;
    });
    scene.step("as trained", |world, prop| _ = world.entity_mut(prop).remove::<Posterize>());
    scene.step("another 0.9 million", |world, prop| {
        world.get_mut::<Prop>(prop).unwrap().0 = world.resource_mut::<Assets<PlenOctree>>().add(small);
    });
    scene.step("5.5 million", |world, prop| {
        world.get_mut::<Prop>(prop).unwrap().0 = world.resource_mut::<Assets<PlenOctree>>().add(large);
    });
    scene.step("all of them exact", |world, _| {
        let camera = world.query_filtered::<Entity, With<Camera3d>>().single(world).unwrap();
        world.entity_mut(camera).insert(QualityPreset::Exact.quality());
    });
    scene.step("toadstool again", |world, prop| world.get_mut::<Prop>(prop).unwrap().0 = toadstool);
    scene.step("no prop", |world, prop| _ = world.despawn(prop));
    Ok(())
}
