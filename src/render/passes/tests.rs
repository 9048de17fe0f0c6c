//! Counts the passes of views, and the bytes that they write and hold.

use std::time::Duration;

use bevy::{platform::collections::HashSet, prelude::*, render::RenderApp};
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

use super::*;
use crate::{
    EdgeSmoothing, FieldPalette, PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop,
    PropPlacement, Recolor,
    headless::{Headless, exact_camera},
    render::frame::{Output, PropView},
};

/// Returns an app with a prop at a distance, and its camera.
fn app(size: UVec2, posterize: Option<Posterize>, distance: f32) -> (Headless, Entity) {
    let mut headless = Headless::new(size, |app| {
        #[cfg(feature = "headless-lit")]
        app.add_plugins(crate::headless::LitMeshPlugins);
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let settings = BakeSettings { depth: 3, basis: Basis::Rgba, ..default() };
    let inside = |at: DVec3| if at.abs().max_element() < 0.5 { 10.0 } else { 0.0 };
    let field = bake(&settings, inside, |_| |_| DVec3::new(0.8, 0.2, 0.1)).unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(field);
    let palette = FieldPalette::from_colors([Color::BLACK, Color::WHITE]).unwrap();
    world.resource_mut::<Palettes>().insert(&field, palette);
    let mut prop = world.spawn(Prop(field));
    if let Some(posterize) = posterize {
        prop.insert(posterize);
    }
    let place = Transform::from_xyz(0.0, 0.0, distance);
    let camera = world.spawn((exact_camera(Color::BLACK), target, place)).id();
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    (headless, camera)
}

/// Hard edges and borders.
fn hard() -> Posterize {
    Posterize { edges: EdgeSmoothing::Off, ..Posterize::paper() }
}

/// Returns the passes of a frame in which the camera has moved: their names, and the bytes that they write per pixel.
fn passes_and_bytes(posterize: Option<Posterize>) -> Vec<(&'static str, u32)> {
    let (mut headless, camera) = app(UVec2::splat(64), posterize, 3.0);
    headless.app.world_mut().get_mut::<Transform>(camera).unwrap().translation.x += 0.01;
    headless.update();
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    let view = world.query::<&PropView>().single(world).unwrap();
    assert_eq!(view.cached.stale().layer, 1);
    view.passes.iter().map(|(pass, _)| (pass.name, written(pass))).collect()
}

fn passes(posterize: Option<Posterize>) -> Vec<&'static str> {
    passes_and_bytes(posterize).into_iter().map(|(name, _)| name).collect()
}

/// Returns the bytes that a pass writes to a pixel, if it writes to all of its attachments.
fn written(pass: &Pass) -> u32 {
    let bytes = |output: &Output| match output {
        Output::Texture(slot) => slot.format().and_then(|format| format.block_copy_size(None)).unwrap_or(4),
        // Four bytes of color, a float of depth, or two half floats.
        Output::Target | Output::PrepassMotion => 4,
    };
    let writes_depth = pass.programs.iter().any(|program| program.depth_test.is_some_and(|test| test.writes));
    let depth = pass.depth.iter().filter(|_| writes_depth);
    pass.writes.iter().flatten().chain(depth).map(bytes).sum()
}

/// `docs/performance.md` lists them.
#[test]
fn passes_write_few_bytes() {
    for (what, posterize, most) in [
        ("as trained", None, 28),
        ("posterized", Some(Posterize::default()), 184),
        ("posterized as in the paper", Some(Posterize::paper()), 236),
    ] {
        let passes = passes_and_bytes(posterize);
        passes.iter().for_each(|(name, bytes)| println!("{what}: {name} {bytes} bytes per pixel"));
        let total: u32 = passes.iter().map(|(_, bytes)| bytes).sum();
        println!("{what}: {total} bytes per pixel");
        assert!(total <= most, "{what}: {total} bytes per pixel");
    }
}

/// Returns how many props a frame draws.
fn drawn_props(headless: &mut Headless) -> usize {
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    let view = world.query::<&PropView>().single(world).unwrap();
    let volume = view.passes.iter().filter(|(pass, _)| pass.name == "plenoctree_volume");
    let props: HashSet<_> = volume.flat_map(|(pass, _)| &pass.draws).map(|draw| draw.instance & 0xffff).collect();
    props.len()
}

/// Returns whether a frame leaves out nothing.
fn is_complete(headless: &mut Headless) -> bool {
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    world.query::<&PropView>().single(world).unwrap().is_complete()
}

/// Props that are drawn stay while pipelines are compiled for what is new: another prop before them, labels, colors, fog,
/// light, and transparent objects.
#[test]
#[cfg(feature = "headless-lit")]
fn props_stay_while_pipelines_are_compiled() {
    let (mut headless, camera) = app(UVec2::splat(64), None, 3.0);
    let world = headless.app.world_mut();
    let first = world.query_filtered::<Entity, With<Prop>>().single(world).unwrap();
    let field = world.get::<Prop>(first).unwrap().0.clone();
    type Change = fn(&mut World, [Entity; 3]);
    let changes: &[(&str, Change)] = &[
        ("overlaps", |world, [_, second, _]| {
            world.entity_mut(second).insert(Transform::from_xyz(0.2, 0.0, 0.8));
        }),
        ("colors", |world, [_, second, _]| {
            let own = PaletteOverride::default().with(0, Color::WHITE);
            world.entity_mut(second).insert((Recolor::default(), own));
        }),
        ("fog", |world, [.., camera]| {
            world.entity_mut(camera).insert(bevy::pbr::DistanceFog::default());
        }),
        ("labels", |world, [first, ..]| {
            world.entity_mut(first).insert(Posterize::default());
        }),
        ("light", |world, [first, ..]| {
            world.entity_mut(first).insert(crate::PropLighting::toon(1.0));
            world.spawn(DirectionalLight::default());
        }),
        ("objects", |world, _| {
            let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::default());
            let material = StandardMaterial { alpha_mode: AlphaMode::Blend, ..default() };
            let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
            world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(0.0, 0.0, 1.5)));
        }),
    ];
    let second = headless.app.world_mut().spawn((Prop(field), Transform::from_xyz(1.2, 0.0, 0.0))).id();
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    assert_eq!(drawn_props(&mut headless), 2);
    for (what, change) in changes {
        if *what == "objects" {
            headless.app.world_mut().entity_mut(camera).insert(PropPlacement::Display);
            headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        }
        change(headless.app.world_mut(), [first, second, camera]);
        let mut frames = 0;
        while frames < 5 || !is_complete(&mut headless) {
            headless.update();
            assert_eq!(drawn_props(&mut headless), 2, "{what}, frame {frames}");
            frames += 1;
        }
    }
}

/// Returns the bytes of GPU memory that a view at rest takes.
fn bytes(size: UVec2, posterize: Option<Posterize>, distance: f32) -> u64 {
    let (mut headless, _) = app(size, posterize, distance);
    (0..6).for_each(|_| headless.update());
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    let view = world.query::<&PropView>().single(world).unwrap();
    assert_eq!(view.cached.stale().layer, 0);
    view.textures.bytes() + view.cached.bytes()
}

/// Textures are as large as what the prop covers.
#[test]
fn small_props_take_little_memory_and_large_ones_what_their_pixels_need() {
    let kinds = [
        ("as trained", None, 24),
        ("hard edges", Some(hard()), 64),
        ("smooth edges", Some(Posterize::paper()), 100),
        ("smooth edges and borders", Some(Posterize { steadiness: 0.0, ..default() }), 112),
        ("steady labels", Some(Posterize::default()), 120),
    ];
    for (what, posterize, most) in kinds {
        let size = UVec2::new(512, 320);
        let filled = bytes(size, posterize, 0.7);
        let pixels = u64::from(size.element_product());
        println!("{what}: {} bytes per pixel", filled as f64 / pixels as f64);
        assert!(filled <= most * pixels, "{what}: {filled} bytes");
        // In a view of 3840 x 2160 pixels, it covers about 64 x 64.
        let small = bytes(UVec2::new(3840, 2160), posterize, 41.0);
        println!("{what}, 64 pixels of 4K: {small} bytes");
        assert!((64 * 64..8 << 20).contains(&small), "{what}: {small} bytes");
    }
}

#[test]
fn views_of_one_prop_have_few_passes() {
    assert_eq!(passes(None), [volume::VOLUME, labels::LABEL, present::PRESENT]);
    let unfiltered = |posterize| {
        let mut passes = passes(Some(posterize));
        passes.retain(|name| *name != labels::FILTER);
        passes
    };
    assert_eq!(unfiltered(hard()), [volume::VOLUME, labels::COMPOSITE, labels::LABEL, present::PRESENT]);
    let (before, after) = (
        [volume::VOLUME, edges::OUTLINE, edges::COVERAGE, labels::COMPOSITE, labels::LABEL],
        [labels::BLEND, present::PRESENT],
    );
    assert_eq!(unfiltered(Posterize::paper()), [&before[..], &after].concat());
    assert_eq!(unfiltered(Posterize::default()), [&before[..], &[finish::FINISH], &after].concat());
}

/// A view in which nothing moves is not drawn again. If only the palette changes, no ray is traced and nothing is
/// filtered.
#[test]
fn still_views_draw_nothing_and_recoloring_draws_labels() {
    let (mut headless, _) = app(UVec2::splat(64), Some(Posterize::default()), 3.0);
    let stale = |headless: &mut Headless| {
        let world = headless.app.sub_app_mut(RenderApp).world_mut();
        let stale = world.query::<&PropView>().single(world).unwrap().cached.stale();
        [stale.layer, stale.composite, stale.labels]
    };
    (0..6).for_each(|_| headless.update());
    assert_eq!(stale(&mut headless), [0, 0, 0]);
    let world = headless.app.world_mut();
    let field = world.query::<&Prop>().single(world).unwrap().0.clone();
    world.resource_mut::<Palettes>().get_mut(&field).unwrap().set(0, Color::srgb(0.2, 0.4, 0.6));
    headless.update();
    assert_eq!(stale(&mut headless), [0, 0, 1]);
}

/// Nor are labels where light falls on them and stays as it is.
#[cfg(feature = "headless-lit")]
#[test]
fn still_views_in_light_draw_no_labels() {
    let (mut headless, _) = app(UVec2::splat(64), Some(Posterize::default()), 3.0);
    let world = headless.app.world_mut();
    let prop = world.query_filtered::<Entity, With<Prop>>().single(world).unwrap();
    world.entity_mut(prop).insert(crate::PropLighting::default());
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    (0..6).for_each(|_| headless.update());
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    let view = world.query::<&PropView>().single(world).unwrap();
    assert!(view.plan.is_lit);
    let stale = view.cached.stale();
    assert_eq!([stale.layer, stale.composite, stale.labels], [0, 0, 0]);
}
