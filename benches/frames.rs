//! Measures the CPU time of a frame: `cargo bench --bench frames -- [FIELD] [CAMERAS] [SIZE]`. The first table is by
//! preset, as trained and posterized, the second by what has changed since the previous frame, and the third with
//! smooth edges against hard ones.
//!
//! Renders a view of 800 x 800 pixels from the first camera. Variants alternate, and the minimum of five rounds counts.
//! It includes reading the frame back. With a GPU, it is the CPU time of the driver.

mod common;

use std::{path::PathBuf, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    EdgeSmoothing, ExtractionSettings, FieldPalette, LoadSettings, Palettes, PlenOctree, PlenOctreePlugin, Posterize,
    Prop, PropQuality, SamplingSettings,
    headless::{Headless, exact_camera, pinhole_view},
};
use cpu_time::ProcessTime;
use plenoctree::{camera::PinholeCamera, palette};
use plenoctree_fit::read_transforms;

const SIZE: &str = "800";
const ROUNDS: usize = 5;
const FRAMES: u32 = 4;
const PATIENCE: Duration = Duration::from_secs(600);

/// What changes from frame to frame.
#[derive(Resource, Clone, Copy, PartialEq, Eq)]
enum Changes {
    Camera,
    Palette,
    Nothing,
}

fn recolor(mut palettes: ResMut<Palettes>, props: Query<&Prop>, mut shade: Local<f32>) {
    *shade = (*shade + 0.1) % 1.0;
    for prop in &props {
        if let Some(palette) = palettes.get_mut(&prop.0) {
            palette.set(0, Color::srgb(*shade, 0.5, 0.5));
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let mut arguments = std::env::args_os().skip(1).filter(|argument| argument != "--bench").map(PathBuf::from);
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.plenoctree");
    let field_file = arguments.next().unwrap_or_else(own);
    let cameras = arguments.next().filter(|file| !file.as_os_str().is_empty());
    let size: u32 = arguments.next().map_or(SIZE.into(), |size| size.to_string_lossy().into_owned()).parse()?;
    let field = PlenOctree::read(field_file, &LoadSettings::default())?;
    let camera = match cameras {
        Some(file) => read_transforms(file, Some((size, size)))?.into_iter().next(),
        None => PinholeCamera::around(&field, size, size, 0.5, 0.4),
    };
    let camera = camera.ok_or("the field is empty, or the file has no cameras")?;
    let sampling = SamplingSettings { sample_fraction: 0.25, ..default() };
    let palette = palette::extract(&field, &ExtractionSettings { sampling, ..default() }, &default())?.palette;

    let mut headless = Headless::new(UVec2::splat(size), |app| {
        app.add_plugins(PlenOctreePlugin).insert_resource(Changes::Camera).add_systems(
            Update,
            (common::sway.run_if(resource_equals(Changes::Camera)), recolor.run_if(resource_equals(Changes::Palette))),
        );
    })?;
    let (target, up) = (headless.target(), field.up());
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
    world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette));
    let prop = world.spawn(Prop(handle)).id();
    let camera = world.spawn((exact_camera(Color::WHITE), target, pinhole_view(&camera, up))).id();
    headless.wait_until_ready(PATIENCE)?;

    let mut least = [[f64::INFINITY; 2]; PropQuality::PRESETS.len()];
    for _ in 0..ROUNDS {
        for ((_, quality), least) in PropQuality::PRESETS.into_iter().zip(&mut least) {
            for (look, least) in [None, Some(Posterize::default())].into_iter().zip(least) {
                let world = headless.app.world_mut();
                world.entity_mut(camera).insert(quality);
                match look {
                    Some(look) => world.entity_mut(prop).insert(look),
                    None => world.entity_mut(prop).remove::<Posterize>(),
                };
                headless.wait_until_ready(PATIENCE)?;
                *least = least.min(time(&mut headless)?);
            }
        }
    }
    println!("| preset | as trained, ms | of exact | posterized, ms | of exact |\n|---|---|---|---|---|");
    for ((preset, _), [trained, posterized]) in PropQuality::PRESETS.into_iter().zip(least) {
        let ratios = [trained / least[0][0], posterized / least[0][1]];
        println!("| {preset} | {trained:.0} | {:.2} | {posterized:.0} | {:.2} |", ratios[0], ratios[1]);
    }

    let world = headless.app.world_mut();
    world.entity_mut(camera).insert(PropQuality::EXACT);
    let rows = [
        ("the camera", Changes::Camera, Visibility::Visible),
        ("the palette", Changes::Palette, Visibility::Visible),
        ("nothing", Changes::Nothing, Visibility::Visible),
        ("the camera, without a prop", Changes::Camera, Visibility::Hidden),
    ];
    let mut least = [f64::INFINITY; 4];
    for _ in 0..ROUNDS {
        for ((_, changes, visibility), least) in rows.iter().zip(&mut least) {
            headless.app.insert_resource(*changes);
            headless.app.world_mut().entity_mut(prop).insert(*visibility);
            *least = least.min(time(&mut headless)?);
        }
    }
    let [moved, .., bevy] = least;
    println!("\n| what changes | posterized, ms | of all | without Bevy's own |\n|---|---|---|---|");
    for ((what, ..), least) in rows.iter().zip(least) {
        let own = (least - bevy) / (moved - bevy);
        println!("| {what} | {least:.1} | {:.3} | {own:.3} |", least / moved);
    }

    headless.app.world_mut().entity_mut(prop).insert(Visibility::Visible);
    let rows = [
        ("the camera", Changes::Camera, Msaa::Off, PropQuality::EXACT),
        ("the palette", Changes::Palette, Msaa::Off, PropQuality::EXACT),
        ("nothing", Changes::Nothing, Msaa::Off, PropQuality::EXACT),
        ("nothing, balanced", Changes::Nothing, Msaa::Off, PropQuality::BALANCED),
        ("the camera, four samples", Changes::Camera, Msaa::Sample4, PropQuality::EXACT),
        ("nothing, four samples", Changes::Nothing, Msaa::Sample4, PropQuality::EXACT),
    ];
    let mut least = [[f64::INFINITY; 2]; 6];
    for _ in 0..ROUNDS {
        for ((_, changes, msaa, quality), least) in rows.iter().zip(&mut least) {
            headless.app.insert_resource(*changes);
            headless.app.world_mut().entity_mut(camera).insert((*msaa, *quality));
            for (edges, least) in [EdgeSmoothing::Off, EdgeSmoothing::Coverage].into_iter().zip(least) {
                headless.app.world_mut().entity_mut(prop).insert(Posterize { edges, ..default() });
                headless.wait_until_ready(PATIENCE)?;
                *least = least.min(time(&mut headless)?);
            }
        }
    }
    println!("\n| what changes | hard edges, ms | smooth, ms | ratio |\n|---|---|---|---|");
    for ((what, ..), [hard, smooth]) in rows.iter().zip(least) {
        println!("| {what} | {hard:.1} | {smooth:.1} | {:.2} |", smooth / hard);
    }
    Ok(())
}

/// Returns the milliseconds of CPU time of a frame.
fn time(headless: &mut Headless) -> Result<f64, Box<dyn std::error::Error>> {
    // What has changed is drawn, and copied in the next frame.
    for _ in 0..3 {
        headless.capture()?;
    }
    let start = ProcessTime::now();
    for _ in 0..FRAMES {
        headless.capture()?;
    }
    Ok(1e3 * start.elapsed().as_secs_f64() / f64::from(FRAMES))
}
