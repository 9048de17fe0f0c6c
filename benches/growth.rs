//! Measures how the work grows. `scripts/growth` runs this benchmark and fits exponents.
//!
//! Fields are spherical shells of SH9 with about the given number of leaves, in the shallowest tree that holds them.
//! They all look alike: the cells get smaller, but the frame stays the same.

mod common;

use std::{io::Cursor, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    Activation, BilateralFilter, ExtractionSettings, FieldPalette, LoadSettings, Palette, Palettes, PlenOctree,
    PlenOctreePlugin, Posterize, Prop, UpAxis,
    headless::{Headless, exact_camera, pinhole_view},
};
use divan::{Bencher, black_box};
use glam::{DVec3, UVec3};
use half::f16;
use plenoctree::{
    Basis, Cell, Frame,
    camera::PinholeCamera,
    palette::{PaletteMethod, extract_from_samples, simplify_hull},
    sampling::{Histograms, Progress, sample},
};

/// Numbers of leaves, from 10^4 to 10^6.5.
const LEAVES: [usize; 6] = [10_000, 31_623, 100_000, 316_228, 1_000_000, 3_162_278];
/// The number of leaves in benchmarks that vary something else.
const SOME_LEAVES: usize = 100_000;
const SIZE: u32 = 256;
const PATIENCE: Duration = Duration::from_secs(120);

fn main() {
    divan::main();
}

/// Creates a shell that is one and a half cells thick.
fn shell(leaves: usize) -> PlenOctree {
    const THICKNESS: f64 = 1.5;
    let radius = (leaves as f64 / (4.0 * std::f64::consts::PI * THICKNESS)).sqrt();
    let depth = (2.0 * radius + 4.0).log2().ceil() as u32;
    let mut shell =
        Shell { radius, half: 0.5 * THICKNESS, middle: f64::from(1u32 << (depth - 1)), nodes: Vec::new(), leaves: 0 };
    shell.node(UVec3::ZERO, 1 << depth);
    let width = Basis::Sh9.coefficients();
    let mut seed = 1u32;
    let coefficients = (0..shell.leaves * width).map(|_| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f16::from_f32(seed as f32 / u32::MAX as f32 - 0.5)
    });
    let frame = Frame::spanning(DVec3::splat(-shell.middle / radius), DVec3::splat(shell.middle / radius));
    // A ray through the shell loses 90% of its light.
    let density = (2.3 * radius / (2.0 * THICKNESS)) as f32;
    let (density, coefficients) = (vec![density; shell.leaves], coefficients.collect());
    PlenOctree::new(frame, Basis::Sh9, Activation::Sigmoid, UpAxis::Z, shell.nodes, density, coefficients).unwrap()
}

struct Shell {
    radius: f64,
    half: f64,
    middle: f64,
    nodes: Vec<[Cell; 8]>,
    leaves: usize,
}

impl Shell {
    fn meets(&self, corner: UVec3, size: u32) -> bool {
        let center = corner.as_dvec3() + 0.5 * f64::from(size) - self.middle;
        let slack = if size == 1 { 0.0 } else { 0.87 * f64::from(size) };
        (center.length() - self.radius).abs() <= self.half + slack
    }

    fn node(&mut self, corner: UVec3, size: u32) -> u32 {
        let (node, half) = (self.nodes.len(), size / 2);
        self.nodes.push([Cell::EMPTY; 8]);
        for index in 0..8 {
            let corner = corner + half * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
            if self.meets(corner, half) {
                self.nodes[node][index as usize] = if half == 1 {
                    self.leaves += 1;
                    Cell::leaf(self.leaves as u32 - 1)
                } else {
                    Cell::node(self.node(corner, half))
                };
            }
        }
        node as u32
    }
}

/// Returns colors whose hull has many corners.
fn colors(count: usize) -> Vec<[f64; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let ball = |index: usize| {
        let z = 1.0 - 2.0 * (index as f64 + 0.5) / count as f64;
        let (sin, cos) = (golden * index as f64).sin_cos();
        let (radius, across) = (0.3 + 0.1 * (index as f64).sin(), (1.0 - z * z).sqrt());
        [across * cos, across * sin, z].map(|x| 0.5 + radius * x)
    };
    (0..count).map(ball).collect()
}

#[divan::bench(args = LEAVES, sample_count = 5, sample_size = 1)]
fn load(bencher: Bencher, leaves: usize) {
    let mut file = Cursor::new(Vec::new());
    shell(leaves).write_to(&mut file).unwrap();
    let bytes = file.into_inner();
    bencher.bench_local(|| PlenOctree::read_from(Cursor::new(&bytes), "shell", &LoadSettings::default()).unwrap());
}

struct Stage {
    headless: Headless,
    camera: Entity,
}

impl Stage {
    fn new(size: u32) -> Self {
        let mut headless = Headless::new(UVec2::splat(size), |app| {
            app.add_plugins(PlenOctreePlugin).add_systems(Update, common::sway);
        })
        .unwrap();
        let target = headless.target();
        let camera = headless.app.world_mut().spawn((exact_camera(Color::WHITE), target)).id();
        headless.wait_until_ready(PATIENCE).unwrap();
        Self { headless, camera }
    }

    /// Spawns a square of props of a field, which together cover the same pixels as a single one.
    fn with_props(size: u32, field: PlenOctree, side: i32, palette: usize) -> Self {
        let mut stage = Self::new(size);
        let view = PinholeCamera::around(&field, size, size, 0.5, 0.0).unwrap();
        let world = stage.headless.app.world_mut();
        world.entity_mut(stage.camera).insert(pinhole_view(&view, field.up()));
        let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
        let palette = Palette::new(colors(palette)).unwrap();
        world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette));
        let scale = 1.0 / side as f32;
        for place in 0..side * side {
            let at = (2.0 * IVec2::new(place % side, place / side).as_vec2() + 1.0) * scale - 1.0;
            // Place them side by side, as seen by the camera.
            let turned = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 + 0.5) * at.extend(0.0);
            world.spawn((Prop(handle.clone()), Transform::from_translation(turned).with_scale(Vec3::splat(scale))));
        }
        stage.headless.wait_until_ready(PATIENCE).unwrap();
        stage
    }

    fn look(&mut self, look: Posterize) {
        let world = self.headless.app.world_mut();
        let props: Vec<_> = world.query_filtered::<Entity, With<Prop>>().iter(world).collect();
        props.into_iter().for_each(|prop| {
            world.entity_mut(prop).insert(look);
        });
    }
}

/// Uploads a field from memory to textures.
#[divan::bench(args = LEAVES, sample_count = 5, sample_size = 1)]
fn upload(bencher: Bencher, leaves: usize) {
    let field = shell(leaves);
    let mut stage = Stage::new(16);
    bencher.bench_local(|| {
        let world = stage.headless.app.world_mut();
        let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
        let prop = world.spawn(Prop(handle)).id();
        stage.headless.wait_until_ready(PATIENCE).unwrap();
        stage.headless.app.world_mut().despawn(prop);
    });
}

/// Captures an exact frame as trained, by number of leaves.
#[divan::bench(args = LEAVES, sample_count = 10, sample_size = 1)]
fn traversal_by_leaves(bencher: Bencher, leaves: usize) {
    let mut stage = Stage::with_props(SIZE, shell(leaves), 1, 6);
    bencher.bench_local(|| stage.headless.capture().unwrap());
}

/// Captures the same frame, by pixels per side.
#[divan::bench(args = [128, 256, 512, 1024], sample_count = 10, sample_size = 1)]
fn traversal_by_side(bencher: Bencher, size: u32) {
    let mut stage = Stage::with_props(size, shell(SOME_LEAVES), 1, 6);
    bencher.bench_local(|| stage.headless.capture().unwrap());
}

/// Captures the same frame, by props per side of a square of constant size.
#[divan::bench(args = [1, 2, 4, 8, 16], sample_count = 10, sample_size = 1)]
fn traversal_by_row_of_props(bencher: Bencher, side: i32) {
    let mut stage = Stage::with_props(SIZE, shell(SOME_LEAVES), side, 6);
    bencher.bench_local(|| stage.headless.capture().unwrap());
}

/// Captures a posterized frame without the filter, by number of palette colors.
#[divan::bench(args = [2, 4, 8, 16], sample_count = 10, sample_size = 1)]
fn labels_by_colors(bencher: Bencher, colors: usize) {
    let mut stage = Stage::with_props(SIZE, shell(SOME_LEAVES), 1, colors);
    let filter = BilateralFilter { iterations: 0, ..default() };
    stage.look(Posterize { filter, ..default() });
    stage.headless.wait_until_ready(PATIENCE).unwrap();
    bencher.bench_local(|| stage.headless.capture().unwrap());
}

/// Samples every leaf in all directions on the CPU.
#[divan::bench(args = LEAVES, sample_count = 3, sample_size = 1)]
fn sampling(bencher: Bencher, leaves: usize) {
    let field = shell(leaves);
    let settings = ExtractionSettings::default();
    bencher.bench_local(|| sample(&field, &settings.sampling, &default()).unwrap());
}

/// Runs k-means and the hull, by number of filled bins in the fine histogram.
#[divan::bench(args = [100, 316, 1_000, 3_162, 10_000], sample_count = 5, sample_size = 1)]
fn clusters(bencher: Bencher, bins: usize) {
    let settings = ExtractionSettings { method: PaletteMethod::Hull, ..default() };
    let (fine, coarse) = (settings.sampling.fine_bins, settings.sampling.coarse_bins);
    let mut weights = [vec![0.0; fine.pow(3)], vec![0.0; coarse.pow(3)]];
    for color in colors(bins) {
        for (weights, bins) in weights.iter_mut().zip([fine, coarse]) {
            let bin = color.map(|channel| (channel * bins as f64) as usize);
            weights[(bin[0] * bins + bin[1]) * bins + bin[2]] += 1.0;
        }
    }
    let [fine_weights, coarse_weights] = weights;
    let histograms = Histograms::new(fine, fine_weights, coarse, coarse_weights, bins as u64).unwrap();
    bencher.bench_local(|| extract_from_samples(&histograms, &[], &settings, &Progress::default()).unwrap());
}

/// Computes a hull and simplifies it to six colors, by number of points.
#[divan::bench(args = [32, 100, 316, 1_000], sample_count = 5, sample_size = 1)]
fn hull(bencher: Bencher, points: usize) {
    let points = colors(points);
    bencher.bench_local(|| simplify_hull(black_box(&points), 6).unwrap());
}
