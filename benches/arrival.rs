//! Prints the times of frames while fields arrive, are shown, swapped and dropped: `cargo bench --bench arrival --
//! [FIELD]`. Without an argument, the field is a generated shell of 0.9 million leaves.
//!
//! The scene is a posterized toadstool, seen with the preset `FAST` by a camera that sways. Each step is compared with
//! the median frame of the second before it, and with that of the second after it, because fields differ in what they
//! cost. A frame ends when the GPU has drawn it. Pipelines are compiled in the background, as in a game.

mod common;

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
    Activation, PaletteExtraction, PaletteSampler, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropQuality,
    PropState, UpAxis,
    headless::{HeadlessPlugins, exact_camera},
};
use cpu_time::ProcessTime;
use glam::{DVec3, UVec3};
use half::f16;
use plenoctree::{Basis, Cell, Frame};

const SIZE: u32 = 256;

/// Creates a shell around the origin, `thickness` finest cells thick.
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

/// A frame: its wall time, the part of it that the main thread took, and the CPU time of all threads but those that
/// work in the background, in milliseconds.
#[derive(Clone, Copy)]
struct Times {
    wall: f64,
    main: f64,
    cpu: f64,
}

/// Returns the CPU time of all threads of this process that draw frames, in milliseconds.
fn frame_threads() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else {
        return 1e3 * ProcessTime::now().as_duration().as_secs_f64();
    };
    let times = threads.flatten().filter_map(|thread| {
        let name = std::fs::read_to_string(thread.path().join("comm")).ok()?;
        let times = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        let time: f64 = times.split(' ').next()?.parse().ok()?;
        (!name.starts_with("plenoctree")).then_some(1e-6 * time)
    });
    times.sum()
}

struct Scene {
    app: App,
    prop: Entity,
    frames: Vec<Times>,
}

impl Scene {
    fn frame(&mut self) -> Times {
        let (start, cpu) = (Instant::now(), frame_threads());
        self.app.update();
        let main = start.elapsed();
        let device = self.app.sub_app(RenderApp).world().resource::<RenderDevice>().clone();
        device.poll(PollType::wait_indefinitely()).unwrap();
        let [wall, main] = [start.elapsed(), main].map(|time| 1e3 * time.as_secs_f64());
        Times { wall, main, cpu: frame_threads() - cpu }
    }

    /// Makes a change, and runs frames until nothing is waited for, and for a second more.
    fn step(&mut self, what: &str, change: impl FnOnce(&mut World, Entity)) {
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
        // The second before the next step.
        let mut left = 1e3;
        let after = times.iter().rev().take_while(|time| {
            left -= time.wall;
            left > 0.0
        });
        let after = after.copied().collect();
        let row = |time: fn(&Times) -> f64| {
            let [before, after] = [&self.frames, &after].map(|frames| median(frames.iter().map(time).collect()));
            let worst = |frames: &[Times]| frames.iter().map(time).fold(0.0, f64::max);
            let most = before.max(after);
            let over = |than: f64| times.iter().filter(|frame| time(frame) > 1.5 * than).count();
            format!(
                "{before:.1} | {:.2} | {after:.1} | {:.2} | {} | {:.2} | {}",
                worst(&self.frames) / before,
                worst(&times) / before,
                over(before),
                worst(&times) / most,
                over(most),
            )
        };
        let (wall, cpu, count) = (row(|time| time.wall), row(|time| time.cpu), times.len());
        let main = median(times.iter().map(|time| time.main).collect());
        let arrived = arrived.unwrap_or_default().as_secs_f64();
        println!("| {what} | {arrived:.2} s | {changing:.2} | {count} | {main:.1} | {wall} | {cpu} |");
        self.frames = after;
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
    app.add_plugins((HeadlessPlugins.set(render).set(assets), PlenOctreePlugin)).add_systems(Update, common::sway);
    app.world_mut().resource_mut::<PaletteExtraction>().sampler = PaletteSampler::Cpu;
    app.finish();
    app.cleanup();
    let image = Image::new_target_texture(SIZE, SIZE, TextureFormat::Rgba8UnormSrgb, None);
    let target = RenderTarget::Image(app.world_mut().resource_mut::<Assets<Image>>().add(image).into());
    let view = Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y);
    let toadstool = app.world().resource::<AssetServer>().load::<PlenOctree>("toadstool.plenoctree");
    let world = app.world_mut();
    world.spawn((exact_camera(Color::WHITE), target, view, PropQuality::FAST));
    let prop = world.spawn((Prop(toadstool.clone()), Posterize::default())).id();
    let mut scene = Scene { app, prop, frames: Vec::new() };

    let small = shell(8, 100.0, 7.4);
    let large = shell(9, 210.0, 10.0);
    println!("leaves: {} and {}\n", small.leaves(), large.leaves());
    println!(
        "Frames in ms: wall time, and CPU time of the threads that draw. Each with the median before, the worst before \
         relative to it, the median after, the worst and those over 1.5 relative to the one before, and relative to the \
         greater one.\n"
    );
    let row = "before | worst before | after | worst | over | worst of both | over of both";
    println!("| change | until drawn | the change itself | frames | main thread | {row} | CPU: {row} |");
    println!("|---|---|---|---|---|{0}{0}", "---|".repeat(7));
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
        world.entity_mut(camera).insert(PropQuality::EXACT);
    });
    scene.step("toadstool again", |world, prop| world.get_mut::<Prop>(prop).unwrap().0 = toadstool);
    scene.step("no prop", |world, prop| _ = world.despawn(prop));
    Ok(())
}
