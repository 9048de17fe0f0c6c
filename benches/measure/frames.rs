//! Frames of one prop, of a prop that fills the view, and of many, while the camera moves; and their passes.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    time::{Duration, Instant},
};

use bevy::{prelude::*, render::diagnostic::RenderDiagnosticsPlugin};
use bevy_plenoctree::{
    LoadSettings, POSTERIZE_SPANS, PlenOctree, PlenOctreePlugin, Posterize, Prop, VOLUME_SPANS,
    headless::{Headless, exact_camera, pinhole_view},
};
use plenoctree::camera::PinholeCamera;

use crate::{
    PATIENCE, Result, SIZES,
    clock::{Times, WARM_UP, milliseconds},
    common::sway,
    files, name,
    rays::Rays,
};

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// The first field, all of it in view, or so near that it fills the view.
    Whole,
    Near,
    /// A square of all fields.
    Many(u32),
}

const SCENES: [(&str, Scene); 4] =
    [("1", Scene::Whole), ("1, fills the view", Scene::Near), ("30", Scene::Many(30)), ("1,000", Scene::Many(1000))];
/// Whether the camera moves.
#[derive(Resource, Clone, Copy, PartialEq, Eq)]
pub struct Sways(pub bool);

pub const LOOKS: [(&str, bool); 2] = [("as trained", false), ("posterized", true)];

pub fn measure(end: Instant) -> Result {
    let (mut headless, camera, fields) = begin(files())?;
    println!("## Frames\n\nMilliseconds of a frame in which the camera moves, with the default quality.\n");
    println!("| props | pixels | look | wall | GPU | rays | posterizing | frames |\n|---|---|---|---|---|---|---|---|");
    let mut last = Duration::ZERO;
    let mut left = (SIZES.len() * SCENES.len() * LOOKS.len()) as u32;
    let mut passes = Passes::default();
    // If the time is up, the largest scenes are left out.
    for (name, scene) in SCENES {
        for size in SIZES {
            headless.resize(size);
            for (look, is_posterized) in LOOKS {
                let row = format!("| {name} | {} x {} | {look}", size.x, size.y);
                let now = Instant::now();
                // This row probably takes no less than the one before it.
                if now + last > end {
                    println!("{row} | not measured: the time was up | | | | |");
                    continue;
                }
                let share = end.duration_since(now) / left;
                left -= 1;
                show(&mut headless, camera, &fields, scene, size, is_posterized.then(Posterize::default))?;
                headless.wait_until_ready(PATIENCE)?;
                let times = Times::measure(&mut headless, WARM_UP, now + share)?;
                last = now.elapsed();
                let [gpu, rays, posterizing] =
                    [times.gpu(), times.of(VOLUME_SPANS), times.of(POSTERIZE_SPANS)].map(milliseconds);
                println!("{row} | {:.1} | {gpu} | {rays} | {posterizing} | {} |", times.wall, times.frames);
                if size == SIZES[0] {
                    passes.add(format!("{name}, {look}"), &times);
                }
            }
        }
    }
    println!("\n## Passes of these scenes\n\nMilliseconds of the GPU.\n");
    passes.print(SIZES[0]);
    println!("## Rays\n\nMeans of the exact rays of the first view that meet a prop's box, counted on the CPU.\n");
    println!("| field | {} |\n|---|{}", Rays::COLUMNS, "---|".repeat(Rays::COLUMNS.split('|').count()));
    for (file, field) in files().iter().zip(&fields) {
        let field = headless.app.world().resource::<Assets<PlenOctree>>().get(field).ok_or("the field is gone")?;
        let view = PinholeCamera::around(field, SIZES[0].x, SIZES[0].y, 0.5, 0.4).ok_or("the field is empty")?;
        println!("| {} | {} |", name(file), Rays::of_view(field, &view));
    }
    println!();
    Ok(())
}

/// The passes of one prop that is seen as a whole, in each look.
pub fn passes(end: Instant) -> Result {
    let (mut headless, camera, fields) = begin(&files()[..1])?;
    let looks = [("as trained", None), ("`paper`", Some(Posterize::paper())), ("default", Some(Posterize::default()))];
    println!("## Passes\n\nMilliseconds of the GPU in frames of one prop, Bevy's own passes included.\n");
    let mut left = (SIZES.len() * looks.len()) as u32;
    for size in SIZES {
        headless.resize(size);
        let mut passes = Passes::default();
        for (name, look) in looks {
            show(&mut headless, camera, &fields, Scene::Whole, size, look)?;
            headless.wait_until_ready(PATIENCE)?;
            let now = Instant::now();
            let share = end.saturating_duration_since(now) / left;
            left -= 1;
            passes.add(name.into(), &Times::measure(&mut headless, WARM_UP, now + share)?);
        }
        passes.print(size);
    }
    Ok(())
}

/// The GPU's times of passes, one column per scene.
#[derive(Default)]
struct Passes {
    scenes: Vec<String>,
    rows: BTreeMap<String, BTreeMap<usize, f64>>,
}

impl Passes {
    fn add(&mut self, scene: String, times: &Times) {
        let all = times.gpu().map(|all| ("all", all));
        for (span, time) in times.spans().chain(all) {
            self.rows.entry(span.into()).or_default().insert(self.scenes.len(), time);
        }
        self.scenes.push(scene);
    }

    fn print(&self, size: UVec2) {
        println!(
            "| {} x {} | {} |\n|---|{}",
            size.x,
            size.y,
            self.scenes.join(" | "),
            "---|".repeat(self.scenes.len())
        );
        for (pass, times) in &self.rows {
            let times: Vec<_> = (0..self.scenes.len()).map(|scene| milliseconds(times.get(&scene).copied())).collect();
            println!("| {} | {} |", pass.trim_start_matches("plenoctree_"), times.join(" | "));
        }
        println!();
    }
}

/// Returns an app that shows props, with palettes that stay, its camera, and the fields.
pub fn begin(files: &[PathBuf]) -> Result<(Headless, Entity, Vec<Handle<PlenOctree>>)> {
    let mut headless = Headless::new(SIZES[0], |app| {
        app.add_plugins((PlenOctreePlugin, RenderDiagnosticsPlugin)).insert_resource(Sways(true));
        app.add_systems(Update, sway.run_if(resource_equals(Sways(true))));
    })?;
    let target = headless.target();
    let camera = headless.app.world_mut().spawn((exact_camera(Color::WHITE), target)).id();
    let fields: Vec<PlenOctree> = files
        .iter()
        .map(|file| PlenOctree::read(file, &LoadSettings::default()))
        .collect::<std::result::Result<_, _>>()?;
    let mut assets = headless.app.world_mut().resource_mut::<Assets<PlenOctree>>();
    let fields: Vec<Handle<PlenOctree>> = fields.into_iter().map(|field| assets.add(field)).collect();
    let first: Vec<_> = fields.iter().map(|field| (Prop(field.clone()), Posterize::default())).collect();
    headless.app.world_mut().spawn_batch(first);
    headless.wait_until_ready(PATIENCE)?;
    Ok((headless, camera, fields))
}

/// Replaces the scene.
pub fn show(
    headless: &mut Headless,
    camera: Entity,
    fields: &[Handle<PlenOctree>],
    scene: Scene,
    size: UVec2,
    look: Option<Posterize>,
) -> Result {
    let world = headless.app.world_mut();
    let old: Vec<Entity> = world.query_filtered::<Entity, With<Prop>>().iter(world).collect();
    old.into_iter().for_each(|prop| _ = world.despawn(prop));
    let count = if let Scene::Many(count) = scene { count } else { 1 };
    let side = f32::from(count as u16).sqrt().ceil();
    for index in 0..count {
        let at = (Vec2::new(index as f32 % side, (index as f32 / side).floor()) - 0.5 * (side - 1.0)) * 2.2;
        let prop = Prop(fields[index as usize % fields.len()].clone());
        let mut prop = world.spawn((prop, Transform::from_xyz(at.x, 0.0, at.y)));
        if let Some(look) = look {
            prop.insert(look);
        }
    }
    let all = side * 2.2;
    let place = match scene {
        Scene::Many(_) => Transform::from_xyz(0.0, 0.6 * all, all).looking_at(Vec3::new(0.0, 0.0, 0.05 * all), Vec3::Y),
        Scene::Whole | Scene::Near => {
            let field = world.resource::<Assets<PlenOctree>>().get(&fields[0]).ok_or("the field is gone")?;
            let view = PinholeCamera::around(field, size.x, size.y, 0.5, 0.4).ok_or("the field is empty")?;
            let (projection, mut place) = pinhole_view(&view, field.up());
            if scene == Scene::Near {
                let (low, high) = field.dense_bounds().ok_or("the field is empty")?;
                let middle = field.up().to_y_up() * (0.5 * (low + high));
                place.translation = middle.as_vec3().lerp(place.translation, 0.3);
            }
            world.entity_mut(camera).insert((projection, place));
            return Ok(());
        }
    };
    world.entity_mut(camera).insert((Projection::default(), place));
    Ok(())
}
