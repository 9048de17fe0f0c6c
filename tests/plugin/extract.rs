//! Tests the example `extract`: its field is sampled on the GPU, and the CPU finds the same palette.

#[path = "../../examples/extract/scene.rs"]
mod scene;

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_plenoctree::{
    PaletteExtraction, PaletteMethod, PaletteSampler, Palettes, PlenOctree, Prop, SampleOrigin,
    headless::{Headless, LitMeshPlugins},
};
use glam::DVec3;

/// Updates the app until the palette of a field was sampled there. Returns its colors.
fn colors(headless: &mut Headless, field: &Handle<PlenOctree>, origin: SampleOrigin) -> Vec<[f64; 3]> {
    let start = Instant::now();
    loop {
        headless.update();
        let extraction = headless.app.world().resource::<PaletteExtraction>();
        if extraction.sampled(field).is_some_and(|sampled| sampled.origin == origin) {
            return headless.app.world().resource::<Palettes>().get(field).unwrap().palette().colors.clone();
        }
        assert!(extraction.error(field).is_none(), "{:?}", extraction.error(field));
        assert!(start.elapsed() < Duration::from_secs(300), "still extracting");
    }
}

#[test]
fn the_example_extract_finds_the_palette_of_the_cpu_on_the_gpu() {
    let mut headless = Headless::new(UVec2::splat(64), |app| {
        app.add_plugins(LitMeshPlugins);
        scene::build(app);
    })
    .unwrap();
    let props = |headless: &mut Headless| {
        let world = headless.app.world_mut();
        world.query::<&Prop>().iter(world).map(|prop| prop.0.clone()).collect::<Vec<_>>()
    };
    // The game runs before the field arrives.
    (1..scene::ARRIVAL).for_each(|_| headless.update());
    assert!(props(&mut headless).is_empty());
    headless.update();
    let field = props(&mut headless).remove(0);
    let on_gpu = colors(&mut headless, &field, SampleOrigin::Gpu);
    // It is animated in the frame in which it is ready.
    let palette = headless.app.world().resource::<Palettes>().get(&field).unwrap();
    assert_ne!(palette.shown(), palette.source());

    let mut extraction = headless.app.world_mut().resource_mut::<PaletteExtraction>();
    extraction.sampler = PaletteSampler::Cpu;
    extraction.settings.method = PaletteMethod::Tones;
    extraction.request(&field);
    let on_cpu = colors(&mut headless, &field, SampleOrigin::Cpu);
    assert_eq!(on_gpu.len(), on_cpu.len());
    for (found, expected) in on_gpu.into_iter().zip(on_cpu) {
        assert!(DVec3::from(found).distance(expected.into()) < 1e-3, "{found:?}, expected {expected:?}");
    }
}
