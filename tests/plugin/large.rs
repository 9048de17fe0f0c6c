//! Reads, draws and samples a field of the size of the largest published ones, 5.5 million leaves of SH9, and draws
//! more props than a camera can.

use std::{io::Cursor, sync::Mutex, time::Duration};

use bevy::{
    log::{
        Level, LogPlugin,
        tracing::{Event, Subscriber, field::Visit},
        tracing_subscriber::{Layer, layer::Context},
    },
    prelude::*,
};
use bevy_plenoctree::{
    Activation, ExtractionSettings, FieldPalette, GpuField, LoadSettings, MAX_PROPS_IN_VIEW, PaletteOverride, Palettes,
    PlenOctree, PlenOctreePlugin, Posterize, Prop, SamplingSettings, UpAxis,
    headless::{Headless, exact_camera, pinhole_view},
};
use glam::{DVec3, UVec3};
use half::f16;
use plenoctree::{Basis, Cell, Frame, camera::PinholeCamera, palette, reference};

const SIZE: u32 = 64;
const DEPTH: u32 = 9;
/// The radius of the shell, in finest cells.
const RADIUS: f64 = 210.0;
/// The thickness of the shell, in finest cells.
const THICKNESS: f64 = 10.0;

/// Adds the nodes under a cell at `corner` that the shell intersects, and returns the index of the first one.
fn grow(nodes: &mut Vec<[Cell; 8]>, leaves: &mut Vec<DVec3>, corner: UVec3, size: u32) -> u32 {
    let (node, half) = (nodes.len(), size / 2);
    nodes.push([Cell::EMPTY; 8]);
    for index in 0..8 {
        let corner = corner + half * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
        let center = corner.as_dvec3() + 0.5 * f64::from(half) - f64::from(1u32 << (DEPTH - 1));
        let slack = if half == 1 { 0.0 } else { 0.87 * f64::from(half) };
        if (center.length() - RADIUS).abs() <= 0.5 * THICKNESS + slack {
            nodes[node][index as usize] = if half == 1 {
                leaves.push(center / RADIUS);
                Cell::leaf(leaves.len() as u32 - 1)
            } else {
                Cell::node(grow(nodes, leaves, corner, half))
            };
        }
    }
    node as u32
}

fn shell() -> PlenOctree {
    let (mut nodes, mut leaves) = (Vec::new(), Vec::new());
    grow(&mut nodes, &mut leaves, UVec3::ZERO, 1 << DEPTH);
    let width = Basis::Sh9.coefficients();
    // Each channel varies with the position. The functions of the direction make it glossy.
    let coefficients = leaves.iter().flat_map(|at| {
        (0..width).map(move |index| {
            let (channel, function) = (index / 9, index % 9);
            let place = (7.0 * at[channel] + function as f64).sin();
            f16::from_f64(if function == 0 { 4.0 * place } else { 0.5 * place })
        })
    });
    let frame = Frame::spanning(DVec3::splat(-256.0 / RADIUS), DVec3::splat(256.0 / RADIUS));
    let (densities, coefficients) = (vec![40.0; leaves.len()], coefficients.collect());
    PlenOctree::new(frame, Basis::Sh9, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients).unwrap()
}

#[test]
fn five_and_a_half_million_leaves_are_read_drawn_and_sampled() {
    let mut file = Cursor::new(Vec::new());
    shell().write_to(&mut file).unwrap();
    let field = PlenOctree::read_from(Cursor::new(file.into_inner()), "shell.npz", &LoadSettings::default()).unwrap();
    assert!(field.leaves() >= 5_500_000, "{} leaves", field.leaves());
    // This is more than a WebGPU binding can hold.
    assert!(GpuField::byte_size(&field) > 2 * (128 << 20));

    let camera = PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4).unwrap();
    let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
    world.spawn(Prop(handle));
    world.spawn((exact_camera(Color::BLACK), target, pinhole_view(&camera, field.up())));
    headless.wait_until_ready(Duration::from_secs(300)).unwrap();
    let frame = headless.capture().unwrap();
    let expected = reference::render(&field, &camera).over(DVec3::ZERO);
    let wrong = frame.pixels().zip(&expected).filter(|(pixel, color)| {
        (0..3).any(|channel| (f64::from(pixel[channel]) - 255.0 * color[channel].clamp(0.0, 1.0)).abs() > 1.5)
    });
    assert_eq!(wrong.count(), 0);

    let settings =
        ExtractionSettings { sampling: SamplingSettings { sample_fraction: 0.01, ..default() }, ..default() };
    let extraction = palette::extract(&field, &settings, &default()).unwrap();
    assert!(extraction.palette.colors.len() > 6 && !extraction.palette.ramps.is_empty());
}

/// The errors that this process has logged.
static LOGGED: Mutex<Vec<String>> = Mutex::new(Vec::new());

struct Logger;

impl<S: Subscriber> Layer<S> for Logger {
    fn on_event(&self, event: &Event, _: Context<S>) {
        struct Text(String);
        impl Visit for Text {
            fn record_debug(&mut self, _: &bevy::log::tracing::field::Field, value: &dyn std::fmt::Debug) {
                self.0 += &format!("{value:?}");
            }
        }
        let mut text = Text(String::new());
        event.record(&mut text);
        LOGGED.lock().unwrap().push(text.0);
    }
}

/// Beyond the documented bound, the nearest props are drawn, with the colors of their own palettes, and an error is
/// logged, once.
#[test]
fn of_too_many_props_the_nearest_are_drawn() {
    const BEYOND: usize = 100;
    let node = std::array::from_fn(|cell| Cell::leaf(cell as u32));
    let frame = Frame::spanning(DVec3::NEG_ONE, DVec3::ONE);
    let black = vec![f16::ZERO; 24];
    let cube = PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, vec![node], vec![1e4; 8], black);
    // Other apps of this process log to it as well.
    let log = LogPlugin {
        level: Level::ERROR,
        filter: "error".into(),
        custom_layer: |_| Some(Box::new(Logger)),
        fmt_layer: |_| Some(Box::new(bevy::log::tracing_subscriber::layer::Identity::new())),
    };
    let mut headless = Headless::new(UVec2::splat(8), |app| {
        app.add_plugins((log, PlenOctreePlugin));
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(cube.unwrap());
    world.resource_mut::<Palettes>().insert(&field, FieldPalette::from_colors([Color::BLACK]).unwrap());
    let view = Transform::from_xyz(0.0, 0.0, 10.0).looking_at(Vec3::ZERO, Vec3::Y);
    world.spawn((exact_camera(Color::WHITE), target, view));
    // One behind the other. The farthest, which are beyond the bound, are beside the others.
    let at = |index: usize| {
        let beside = if index >= MAX_PROPS_IN_VIEW { 4.0 } else { 0.0 };
        Transform::from_xyz(beside, 0.0, -1e-4 * index as f32)
    };
    let nearest =
        (Prop(field.clone()), Posterize::default(), PaletteOverride::default().with(0, Color::srgb(0.0, 0.0, 1.0)));
    world.spawn(nearest);
    world.spawn_batch(
        (1..MAX_PROPS_IN_VIEW + BEYOND).map(move |index| (Prop(field.clone()), at(index))).collect::<Vec<_>>(),
    );
    headless.wait_until_ready(Duration::from_secs(300)).unwrap();
    let frame = headless.capture().unwrap();
    assert_eq!(frame.get_pixel(4, 4).0, [0, 0, 255, 255], "the nearest");
    assert_eq!(frame.get_pixel(7, 4).0, [255; 4], "those beyond the bound");
    headless.update();
    let logged = LOGGED.lock().unwrap();
    let logged: Vec<_> = logged.iter().filter(|error| error.contains("a camera sees")).collect();
    let expected =
        format!("a camera sees {} props but draws only the nearest {MAX_PROPS_IN_VIEW}", MAX_PROPS_IN_VIEW + BEYOND);
    assert_eq!(logged, [&expected]);
}
