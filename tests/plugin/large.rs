//! Reads, draws and samples a field of the size of the largest published ones, 5.5 million leaves of SH9, and draws
//! more props than a camera can.

use std::{io::Cursor, sync::Mutex};

use bevy::{
    log::{
        Level, LogPlugin,
        tracing::{Event, Subscriber, field::Visit},
        tracing_subscriber::{Layer, layer::Context},
    },
    prelude::*,
};
use bevy_plenoctree::{
    Activation, ExtractionSettings, FieldPalette, GpuField, LoadSettings, MAX_PROPS_IN_VIEW, PaletteOverride,
    PlenOctree, Posterize, Prop, SamplingSettings, UpAxis,
};
use glam::DVec3;
use half::f16;
use plenoctree::{Basis, Frame, camera::PinholeCamera, palette, reference};

use super::stage::{
    Stage,
    fields::{Shell, eight},
    pixels::is_off,
};

const SIZE: u32 = 64;
/// The radius of the shell, in finest cells.
const RADIUS: f64 = 210.0;

fn shell() -> PlenOctree {
    let Shell { nodes, leaves } = Shell::new(9, RADIUS, 10.0);
    // Each channel varies with the position. The functions of the direction make it glossy.
    const STEPS: usize = 1 << 12;
    let of_step = |step: usize| {
        let at = (2 * step) as f64 / STEPS as f64 - 1.0;
        std::array::from_fn::<_, 9, _>(|function| {
            let place = (7.0 * at * 256.0 / RADIUS + function as f64).sin();
            f16::from_f64(if function == 0 { 4.0 * place } else { 0.5 * place })
        })
    };
    let of_channel: Vec<_> = (0..=STEPS).map(of_step).collect();
    let mut coefficients = Vec::with_capacity(27 * leaves.len());
    for leaf in &leaves {
        let step = ((0.5 * STEPS as f64) * (leaf + 1.0)).as_uvec3();
        [step.x, step.y, step.z].iter().for_each(|step| coefficients.extend_from_slice(&of_channel[*step as usize]));
    }
    let frame = Frame::spanning(DVec3::splat(-256.0 / RADIUS), DVec3::splat(256.0 / RADIUS));
    let densities = vec![40.0; leaves.len()];
    PlenOctree::new(frame, Basis::Sh9, Activation::Sigmoid, UpAxis::Z, nodes, densities, coefficients).unwrap()
}

#[test]
#[ignore = "slow: `scripts/test all` runs it"]
fn five_and_a_half_million_leaves_are_read_drawn_and_sampled() {
    let mut file = Cursor::new(Vec::new());
    shell().write_to(&mut file).unwrap();
    let field = PlenOctree::read_from(Cursor::new(file.into_inner()), "shell.npz", &LoadSettings::default()).unwrap();
    assert!(field.leaves() >= 5_500_000, "{} leaves", field.leaves());
    // This is more than a WebGPU binding can hold.
    assert!(GpuField::byte_size(&field) > 2 * (128 << 20));

    let camera = PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4).unwrap();
    let frame = Stage::of(SIZE, &field).capture_from(&camera, field.up());
    let expected = reference::render(&field, &camera).over(DVec3::ZERO);
    let wrong = frame.pixels().zip(&expected).filter(|(pixel, color)| is_off(pixel, **color, 1.5));
    assert_eq!(wrong.count(), 0);

    let settings =
        ExtractionSettings { sampling: SamplingSettings { sample_fraction: Some(0.01), ..default() }, ..default() };
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
#[ignore = "slow: `scripts/test all` runs it"]
fn of_too_many_props_the_nearest_are_drawn() {
    const BEYOND: usize = 100;
    // Other apps of this process log to it as well.
    let log = LogPlugin {
        level: Level::ERROR,
        filter: "error".into(),
        custom_layer: |_| Some(Box::new(Logger)),
        fmt_layer: |_| Some(Box::new(bevy::log::tracing_subscriber::layer::Identity::new())),
    };
    let mut stage = Stage::with(UVec2::splat(8), |app| _ = app.add_plugins(log));
    stage.set_background(Color::WHITE);
    stage.set(Transform::from_xyz(0.0, 0.0, 10.0).looking_at(Vec3::ZERO, Vec3::Y));
    let own = PaletteOverride::default().with(0, Color::srgb(0.0, 0.0, 1.0));
    stage.spawn_prop(&eight(Basis::Rgba, 1e4, &[f16::ZERO; 3]), (Posterize::default(), own));
    stage.paint(FieldPalette::from_colors([Color::BLACK]).unwrap());
    // One behind the other. The farthest, which are beyond the bound, are beside the others.
    let at = |index: usize| {
        let beside = if index >= MAX_PROPS_IN_VIEW { 4.0 } else { 0.0 };
        Transform::from_xyz(beside, 0.0, -1e-4 * index as f32)
    };
    let others = (1..MAX_PROPS_IN_VIEW + BEYOND).map(|index| (Prop(stage.field()), at(index))).collect::<Vec<_>>();
    stage.world().spawn_batch(others);
    stage.wait();
    let frame = stage.capture();
    assert_eq!(frame.get_pixel(4, 4).0, [0, 0, 255, 255], "the nearest");
    assert_eq!(frame.get_pixel(7, 4).0, [255; 4], "those beyond the bound");
    stage.update(1);
    let logged = LOGGED.lock().unwrap();
    let logged: Vec<_> = logged.iter().filter(|error| error.contains("a camera sees")).collect();
    let expected =
        format!("a camera sees {} props but draws only the nearest {MAX_PROPS_IN_VIEW}", MAX_PROPS_IN_VIEW + BEYOND);
    assert_eq!(logged, [&expected]);
}
