//! Tests the example `extract`: its field is sampled on the GPU, and the CPU finds the same palette.

#[path = "../../examples/extract/scene.rs"]
mod scene;

use bevy::prelude::*;
use bevy_plenoctree::{
    PaletteExtraction, PaletteMethod, PaletteSampler, Palettes, PlenOctree, Prop, SampleOrigin,
    headless::LitMeshPlugins,
};
use glam::DVec3;

use super::stage::{Stage, wait_for};

/// Updates the app until the palette of a field was sampled there. Returns its colors.
fn colors(stage: &mut Stage, field: &Handle<PlenOctree>, origin: SampleOrigin) -> Vec<[f64; 3]> {
    wait_for("a palette", || {
        stage.update(1);
        let extraction = stage.resource::<PaletteExtraction>();
        assert!(extraction.error(field).is_none(), "{:?}", extraction.error(field));
        extraction.sampled(field).is_some_and(|sampled| sampled.origin == origin)
    });
    stage.resource::<Palettes>().get(field).unwrap().palette().colors.clone()
}

#[test]
fn the_example_extract_finds_the_palette_of_the_cpu_on_the_gpu() {
    let mut stage = Stage::with(UVec2::splat(64), |app| {
        app.add_plugins(LitMeshPlugins);
        scene::build(app);
    });
    stage.close();
    let sampling = &mut stage.world().resource_mut::<PaletteExtraction>().settings.sampling;
    (sampling.sample_fraction, sampling.directions) = (Some(0.03), 1);
    let props = |stage: &mut Stage| {
        let world = stage.world();
        world.query::<&Prop>().iter(world).map(|prop| prop.0.clone()).collect::<Vec<_>>()
    };
    // The game runs before the field arrives.
    stage.update(scene::ARRIVAL as usize - 1);
    assert!(props(&mut stage).is_empty());
    stage.update(1);
    let field = props(&mut stage).remove(0);
    let on_gpu = colors(&mut stage, &field, SampleOrigin::Gpu);
    // It is animated in the frame in which it is ready.
    let palette = stage.world().resource::<Palettes>().get(&field).unwrap();
    assert!(!palette.source().eq(palette.shown().iter().copied()));

    let mut extraction = stage.world().resource_mut::<PaletteExtraction>();
    extraction.sampler = PaletteSampler::Cpu;
    extraction.settings.method = PaletteMethod::Tones;
    extraction.request(&field);
    let on_cpu = colors(&mut stage, &field, SampleOrigin::Cpu);
    assert_eq!(on_gpu.len(), on_cpu.len());
    for (found, expected) in on_gpu.into_iter().zip(on_cpu) {
        assert!(DVec3::from(found).distance(expected.into()) < 1e-3, "{found:?}, expected {expected:?}");
    }
}
