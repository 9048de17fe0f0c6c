//! Measures what overlapping props cost: `cargo bench --bench overlap -- [FIELD]`.
//!
//! Two props of a field stand one behind the other, in a view of 800 x 800 pixels. Where props overlap, the solid pass
//! finds their nearest solid parts. Props that are never solid do without it, so they are the baseline. Variants
//! alternate, and the minimum CPU time of seven rounds counts.

mod common;

use std::{path::PathBuf, time::Duration};

use bevy::prelude::*;
use bevy_plenoctree::{
    LoadSettings, PlenOctree, PlenOctreePlugin, Prop, SolidOpacity,
    headless::{Headless, exact_camera, pinhole_view},
};
use cpu_time::ProcessTime;
use plenoctree::camera::PinholeCamera;

const SIZE: u32 = 800;
const ROUNDS: usize = 7;
const FRAMES: u32 = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let argument = std::env::args_os().skip(1).find(|argument| argument != "--bench").map(PathBuf::from);
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.plenoctree");
    let field = PlenOctree::read(argument.unwrap_or_else(own), &LoadSettings::default())?;
    let camera = PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4).ok_or("the field is empty")?;
    let (low, high) = field.bounds().ok_or("the field is empty")?;
    let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins(PlenOctreePlugin).add_systems(Update, common::sway);
    })?;
    let (target, up) = (headless.target(), field.up());
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
    let (projection, place) = pinhole_view(&camera, up);
    // Offset by a quarter of its size to the side, and by half of its size to the back.
    let size = (high - low).max_element() as f32;
    let behind = place.rotation * Vec3::new(0.25 * size, 0.0, -0.5 * size);
    world.spawn((exact_camera(Color::WHITE), target, projection, place));
    let first = world.spawn(Prop(handle.clone())).id();
    let second = world.spawn((Prop(handle), Transform::from_translation(behind))).id();
    headless.wait_until_ready(Duration::from_secs(600))?;

    println!("| props | never solid, ms | solid, ms | ratio |\n|---|---|---|---|");
    for (what, shown) in [("one", Visibility::Hidden), ("two, overlapping", Visibility::Visible)] {
        headless.app.world_mut().entity_mut(second).insert(shown);
        let mut least = [f64::INFINITY; 2];
        for _ in 0..ROUNDS {
            for (least, solid) in least.iter_mut().zip([SolidOpacity::Never, SolidOpacity::default()]) {
                for prop in [first, second] {
                    headless.app.world_mut().entity_mut(prop).insert(solid);
                }
                headless.capture()?;
                let start = ProcessTime::now();
                for _ in 0..FRAMES {
                    headless.capture()?;
                }
                *least = least.min(1e3 * start.elapsed().as_secs_f64() / f64::from(FRAMES));
            }
        }
        println!("| {what} | {:.0} | {:.0} | {:.2} |", least[0], least[1], least[1] / least[0]);
    }
    Ok(())
}
