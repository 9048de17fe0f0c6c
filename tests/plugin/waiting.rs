//! Tests what waiting for props costs, and how their progress rises meanwhile.

use std::time::Duration;

use bevy::{
    core_pipeline::schedule::Core3d,
    ecs::system::RunSystemOnce,
    prelude::*,
    render::{RenderApp, render_asset::RenderAssets},
};
use bevy_plenoctree::{
    FieldPalette, GpuField, PaletteExtraction, PaletteSampler, Palettes, PlenOctree, PlenOctreePlugin, Posterize,
    PosterizeView, Prop, PropProgress, PropQuality, PropState, props_progress, props_ready,
};

use super::stage::{Stage, skip, wait_for};

/// The number of times that the camera has drawn.
#[derive(Resource, Default)]
struct Drawn(usize);

/// Two times two props of two included fields.
fn scene(posterized: bool) -> Stage {
    let mut stage = Stage::with(UVec2::new(64, 48), |app| {
        let count = |mut drawn: ResMut<Drawn>| drawn.0 += 1;
        app.sub_app_mut(RenderApp).init_resource::<Drawn>().add_systems(Core3d, count);
    });
    stage.set_background(Color::WHITE);
    stage.set((Transform::from_xyz(0.0, 2.0, 8.0).looking_at(Vec3::ZERO, Vec3::Y), PropQuality::EXACT));
    for index in 0..4 {
        let name = ["robot", "drum"][index % 2];
        let field: Handle<PlenOctree> = stage.resource::<AssetServer>().load(format!("{name}.plenoctree"));
        let prop = stage.spawn((Prop(field), Transform::from_xyz(2.0 * index as f32 - 3.0, 0.0, 0.0)));
        if posterized {
            stage.insert(prop, Posterize::default());
        }
    }
    stage
}

fn drawn(stage: &Stage) -> usize {
    stage.render_world().resource::<Drawn>().0
}

/// Frames are drawn when there is something to see, and a frame that waits for levels is not drawn again and again: on
/// a GPU that is emulated in software, drawing takes the time that props need to get ready.
#[test]
fn waiting_draws_next_to_nothing() {
    let mut stage = scene(true);
    if !stage.is_on_cpu() {
        return skip("a GPU that is emulated in software: others draw many frames while a level is made");
    }
    stage.wait();
    assert!((1..=4).contains(&drawn(&stage)), "drawn {} times", drawn(&stage));
    let before = drawn(&stage);
    let exact = stage.capture();
    assert_eq!(drawn(&stage), before + 1);

    // Each level is drawn when it is there, and all are when nothing is missing.
    stage.set(PropQuality { cell_size: 2.0, ..PropQuality::EXACT });
    let before = drawn(&stage);
    let coarse = stage.capture();
    assert!(coarse != exact);
    let fields = stage.render_world().resource::<RenderAssets<GpuField>>();
    assert!(fields.iter().all(|(_, field)| !field.has_pending_levels()));
    // Two fields have a level each.
    assert!(drawn(&stage) - before <= 6, "drawn {} times", drawn(&stage) - before);
}

/// A level that no camera requests any more, although it is being made, does not keep others waiting.
#[test]
fn abandoned_levels_hold_nothing_up() {
    let mut stage = scene(false);
    if !stage.is_on_cpu() {
        return skip("a GPU that is emulated in software: others draw many frames while a level is made");
    }
    stage.wait();
    let quality = |cell_size| PropQuality { cell_size, ..PropQuality::EXACT };
    stage.set(quality(2.0));
    stage.update(2);
    stage.set(quality(6.0));
    let before = drawn(&stage);
    stage.capture();
    // The level that is abandoned takes hundreds of frames.
    assert!(drawn(&stage) - before <= 100, "drawn {} times", drawn(&stage) - before);
}

/// From the first frame to the last, progress rises from 0 to 1, and it does not end before everything is there.
#[test]
fn progress_rises_to_the_end() {
    let mut stage = scene(false);
    let is_on_cpu = stage.is_on_cpu();
    let world = stage.world();
    // Graphics cards sample too fast to see progress.
    world.resource_mut::<PaletteExtraction>().sampler = PaletteSampler::Cpu;
    // One of them needs a palette that no file holds.
    let field = world.resource::<AssetServer>().load("toadstool.plenoctree");
    let toadstool = world.spawn((Prop(field), Posterize::default(), Transform::from_xyz(0.0, -9.0, 0.0))).id();
    let (mut progress, mut palette, mut early) = (vec![0.0], vec![0.0], 0);
    while let Err(error) = stage.headless.wait_until_ready(Duration::ZERO) {
        let world = stage.world();
        assert!(error.to_string().contains("timed out"), "{error}");
        let now = world.run_system_once(props_progress).unwrap();
        let has_all = |state: &PropState| matches!(state, PropState::Ready | PropState::Compiling);
        early += usize::from(now == 1.0 && !world.query::<&PropState>().iter(world).all(has_all));
        progress.push(now);
        palette.extend(world.get::<PropProgress>(toadstool).unwrap().palette);
        std::thread::sleep(Duration::from_millis(2));
    }
    let world = stage.world();
    assert!(world.query::<&PropState>().iter(world).all(PropState::is_ready));
    progress.push(world.run_system_once(props_progress).unwrap());
    assert_eq!(progress.last(), Some(&1.0));
    // Threads count what they have done before they pass it on, and states follow some frames later.
    assert!(early <= 3 + progress.len() / 10, "at the end for {early} of {} frames", progress.len());
    for values in [&progress, &palette] {
        assert!(values.is_sorted(), "{values:?}");
    }
    if !is_on_cpu {
        return skip("a GPU that is emulated in software: next to others, most frames see no progress");
    }
    for values in [&progress, &palette] {
        assert!(values.windows(2).filter(|pair| pair[1] > pair[0]).count() > 20, "{values:?}");
    }
    // Sampling is half of an extraction, and the rest is counted, too.
    assert!(palette.iter().filter(|share| (0.55..0.95).contains(*share)).count() > 5, "{palette:?}");
}

/// A field with many props counts as much as one with a single prop, and waits for what the slowest of them waits for.
#[test]
fn progress_counts_each_field_once() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    let world = app.world_mut();
    assert_eq!(world.run_system_once(props_progress).unwrap(), 1.0);
    let assets = world.resource::<Assets<PlenOctree>>();
    let [crowd, single] = [assets.reserve_handle(), assets.reserve_handle()];
    for _ in 0..9 {
        world.spawn((Prop(crowd.clone()), PropProgress { read: 1.0, uploaded: 1.0, palette: None }));
    }
    world.spawn((Prop(single), PropProgress::default()));
    assert_eq!(world.run_system_once(props_progress).unwrap(), 0.5);
    world.spawn((Prop(crowd.clone()), PropProgress { read: 1.0, uploaded: 1.0, palette: Some(0.25) }));
    assert_eq!(world.run_system_once(props_progress).unwrap(), 0.375);
    // A posterized view counts if no prop shows its field.
    world.spawn(PosterizeView(crowd));
    assert_eq!(world.run_system_once(props_progress).unwrap(), 0.375);
}

/// A posterized view waits for its palette, unless there will be none.
#[test]
fn posterized_views_wait_for_their_palettes() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    let world = app.world_mut();
    let known = world.resource::<Assets<PlenOctree>>().reserve_handle();
    let missing = world.resource::<AssetServer>().load("no such field.plenoctree");
    let both = |world: &mut World| {
        (world.run_system_once(props_ready).unwrap(), world.run_system_once(props_progress).unwrap())
    };
    assert_eq!(both(world), (true, 1.0));
    let view = world.spawn(PosterizeView(known.clone())).id();
    assert_eq!(both(world), (false, 0.0));
    world.resource_mut::<Palettes>().insert(&known, FieldPalette::from_colors([Color::WHITE]).unwrap());
    assert_eq!(both(world), (true, 1.0));
    world.entity_mut(view).insert(PosterizeView(missing));
    assert_eq!(both(world), (false, 0.0));
    wait_for("an error", || {
        app.update();
        both(app.world_mut()) == (true, 1.0)
    });
}
