//! Measures the CPU time of a frame by preset, as trained and posterized: `cargo bench --bench frames -- [FIELD]
//! [CAMERAS]`.
//!
//! Renders a view of 800 x 800 pixels from the first camera. Variants take turns, and the least time of five rounds
//! counts. It includes reading the frame back. With a GPU, it is the CPU time of the driver.

use std::{path::PathBuf, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    FieldPalette, LoadSettings, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop, QualityPreset,
    headless::{Headless, exact_camera, pinhole_view},
};
use cpu_time::ProcessTime;
use plenoctree::{
    camera::{PinholeCamera, read_transforms},
    palette,
};

const SIZE: u32 = 800;
const ROUNDS: usize = 5;
const FRAMES: u32 = 4;
const PATIENCE: Duration = Duration::from_secs(600);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let mut arguments = std::env::args_os().skip(1).filter(|argument| argument != "--bench").map(PathBuf::from);
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.npz");
    let field = PlenOctree::read(arguments.next().unwrap_or_else(own), &LoadSettings::default())?;
    let camera = match arguments.next() {
        Some(file) => read_transforms(file, Some((SIZE, SIZE)))?.into_iter().next(),
        None => PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4),
    };
    let camera = camera.ok_or("the field is empty, or the file has no cameras")?;
    let palette = palette::extract(&field, &QualityPreset::Fast.extraction(), &default())?.palette;

    let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;
    let (target, up) = (headless.target(), field.up());
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
    world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette));
    let prop = world.spawn(Prop(handle)).id();
    let camera = world.spawn((exact_camera(Color::WHITE), target, pinhole_view(&camera, up))).id();
    headless.wait_until_ready(PATIENCE)?;

    let mut least = [[f64::INFINITY; 2]; QualityPreset::ALL.len()];
    for _ in 0..ROUNDS {
        for (preset, least) in QualityPreset::ALL.into_iter().zip(&mut least) {
            for (look, least) in [None, Some(Posterize::default())].into_iter().zip(least) {
                let world = headless.app.world_mut();
                world.entity_mut(camera).insert(preset.quality());
                match look {
                    Some(look) => world.entity_mut(prop).insert(look),
                    None => world.entity_mut(prop).remove::<Posterize>(),
                };
                headless.wait_until_ready(PATIENCE)?;
                headless.capture()?;
                let start = ProcessTime::now();
                for _ in 0..FRAMES {
                    headless.capture()?;
                }
                *least = least.min(1e3 * start.elapsed().as_secs_f64() / f64::from(FRAMES));
            }
        }
    }
    println!("| preset | as trained, ms | of exact | posterized, ms | of exact |\n|---|---|---|---|---|");
    for (preset, [trained, posterized]) in QualityPreset::ALL.into_iter().zip(least) {
        let ratios = [trained / least[0][0], posterized / least[0][1]];
        println!("| {preset:?} | {trained:.0} | {:.2} | {posterized:.0} | {:.2} |", ratios[0], ratios[1]);
    }
    Ok(())
}
