//! Fields that arrive while frames are drawn, and their memory.

use std::time::Instant;

use bevy::{
    prelude::*,
    render::{RenderApp, render_asset::RenderAssets},
};
use bevy_plenoctree::{
    GpuField, LoadSettings, PlenOctree, PlenOctreePlugin, Prop, PropState,
    headless::{Headless, exact_camera},
};

use crate::{PATIENCE, Result, clock::draw, files, name};

pub fn measure() -> Result {
    println!(
        "## Arrival and memory\n\nFrom a field in main memory to the first frame that shows it, with the default budget.\n"
    );
    println!("| field | leaves | s | longest frame, ms | MB on the GPU | bytes per leaf |\n|---|---|---|---|---|---|");
    let mut headless = Headless::new(UVec2::splat(256), |app| {
        app.add_plugins(PlenOctreePlugin);
    })?;
    let target = headless.target();
    let place = Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y);
    headless.app.world_mut().spawn((exact_camera(Color::WHITE), target, place));
    // The first field brings the pipelines, and does not count.
    for (index, file) in files()[..1].iter().chain(files()).enumerate() {
        let field = PlenOctree::read(file, &LoadSettings::default())?;
        let name = name(file);
        let leaves = field.leaves();
        let world = headless.app.world_mut();
        let field = world.resource_mut::<Assets<PlenOctree>>().add(field);
        let prop = world.spawn(Prop(field.clone())).id();
        let start = Instant::now();
        let mut longest = 0.0f64;
        while headless.app.world().get::<PropState>(prop) != Some(&PropState::Ready) {
            let frame = Instant::now();
            draw(&mut headless)?;
            longest = longest.max(1e3 * frame.elapsed().as_secs_f64());
            if start.elapsed() > PATIENCE {
                return Err(format!("{name} does not arrive").into());
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        let fields = headless.app.sub_app(RenderApp).world().resource::<RenderAssets<GpuField>>();
        let bytes = fields.get(&field).map_or(0, GpuField::bytes) as f64;
        if index > 0 {
            let per_leaf = bytes / leaves as f64;
            println!("| {name} | {leaves} | {seconds:.2} | {longest:.1} | {:.1} | {per_leaf:.1} |", bytes / 1e6);
        }
        headless.app.world_mut().despawn(prop);
    }
    println!();
    Ok(())
}
