//! Captures frames of a prop without a window: as trained, posterized, and with its red turned blue.
//!
//! ```sh
//! cargo run --release -p headless
//! ```

use std::{f32::consts::TAU, fs, path::Path, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    PaletteExtraction,
    headless::{Headless, exact_camera},
    prelude::*,
};

const FRAMES: u32 = 8;

fn main() -> Result {
    let out = Path::new("out");
    fs::create_dir_all(out)?;
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
    let mut headless = Headless::with_assets(UVec2::splat(800), &assets, |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;

    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource::<AssetServer>().load("toadstool.plenoctree");
    let prop = world.spawn(Prop(field.clone())).id();
    let camera = world.spawn((exact_camera(Color::WHITE), target)).id();
    turn(&mut headless, camera, "original", out)?;

    headless.app.world_mut().entity_mut(prop).insert(Posterize::default());
    turn(&mut headless, camera, "posterized", out)?;
    report(headless.app.world(), &field);

    // The palette is complete. Its red is that of the cap, from shadow to highlight.
    if let Some(palette) = headless.app.world_mut().resource_mut::<Palettes>().get_mut(&field)
        && let Some(red) = palette.ramp("red")
    {
        palette.set_ramp(red, Color::srgb_u8(0x20, 0x50, 0xd0));
    }
    turn(&mut headless, camera, "recolored", out)
}

/// Prints where the field was sampled, and what its palette was extracted from.
fn report(world: &World, field: &Handle<PlenOctree>) {
    let (extraction, palettes) = (world.resource::<PaletteExtraction>(), world.resource::<Palettes>());
    let leaves = world.resource::<Assets<PlenOctree>>().get(field).map_or(0, PlenOctree::leaves);
    let found = palettes.get(field).and_then(|palette| palette.extraction());
    if let (Some(found), Some(samples)) = (found, extraction.sampled(field)) {
        let (of, seconds) = (found.radiance_samples, found.seconds);
        println!("Sampled {leaves} leaves {}: {of} radiance samples in {:.2} s", samples.origin, seconds.sampling);
        println!("Fitted {} colors to them in {:.2} s", found.palette.colors.len(), seconds.fitting);
    }
}

/// Captures frames from all around, and saves them to `out`.
fn turn(headless: &mut Headless, camera: Entity, name: &str, out: &Path) -> Result {
    headless.wait_until_ready(Duration::from_secs(120))?;
    for frame in 0..FRAMES {
        let turn = Quat::from_rotation_y(TAU * frame as f32 / FRAMES as f32);
        let view = Transform::from_translation(turn * Vec3::new(1.5, 1.3, 3.2)).looking_at(Vec3::ZERO, Vec3::Y);
        headless.app.world_mut().entity_mut(camera).insert(view);
        headless.capture()?.save(out.join(format!("frame_{frame:03}.{name}.png")))?;
    }
    Ok(())
}
