//! Counts the passes of views, and the bytes that they write and hold.

use std::{hash::BuildHasher, time::Duration};

use bevy::{
    camera::visibility::NoFrustumCulling,
    platform::{
        collections::{HashMap, HashSet},
        hash::FixedHasher,
    },
    prelude::*,
    render::{Render, RenderApp},
};
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};
use proptest::prelude::ProptestConfig;

use super::*;
use crate::{
    BilateralFilter, EdgeSmoothing, FieldPalette, Ink, PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin,
    Posterize, PosterizeView, Prop, PropPlacement, PropQuality, Recolor,
    gpu::LeftOut,
    headless::{Headless, exact_camera},
    render::{
        frame::{CachedResult, PropView, Slot},
        plan::Feature,
    },
    sets::PlenOctreeRenderSystems,
};

/// Returns a field that is a cube of one color.
fn cube(basis: Basis, color: DVec3) -> PlenOctree {
    let inside = |at: DVec3| if at.abs().max_element() < 0.5 { 10.0 } else { 0.0 };
    bake(&BakeSettings { depth: 3, basis, ..default() }, inside, |_| move |_| color).unwrap()
}

/// Returns an app that `configure` adds to, with a prop at the origin, and its camera at z = 3.
fn app(posterize: Option<Posterize>, configure: fn(&mut App)) -> (Headless, Entity) {
    let mut headless = Headless::new(UVec2::splat(64), |app| {
        configure(app);
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(cube(Basis::Rgba, DVec3::new(0.8, 0.2, 0.1)));
    let palette = FieldPalette::from_colors([Color::BLACK, Color::WHITE]).unwrap();
    world.resource_mut::<Palettes>().insert(&field, palette);
    world.spawn(Prop(field));
    let place = Transform::from_xyz(0.0, 0.0, 3.0);
    let camera = world.spawn((exact_camera(Color::BLACK), target, place)).id();
    posterize_all(&mut headless, posterize);
    (headless, camera)
}

#[cfg(feature = "headless-lit")]
fn lit(app: &mut App) {
    app.add_plugins(crate::headless::LitMeshPlugins);
}

/// Gives all props these settings, or shows them as trained.
fn posterize_all(headless: &mut Headless, posterize: Option<Posterize>) {
    let world = headless.app.world_mut();
    for prop in world.query_filtered::<Entity, With<Prop>>().iter(world).collect::<Vec<_>>() {
        match posterize {
            Some(posterize) => world.entity_mut(prop).insert(posterize),
            None => world.entity_mut(prop).remove::<Posterize>(),
        };
    }
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
}

/// Returns what the render world knows of the camera's view.
fn view(headless: &mut Headless) -> &PropView {
    let world = headless.app.sub_app_mut(RenderApp).world_mut();
    world.query::<&PropView>().single(world).unwrap()
}

/// Hard edges and borders.
fn hard() -> Posterize {
    Posterize { edges: EdgeSmoothing::Off, ..Posterize::paper() }
}

/// Returns the passes of a frame in which the camera has moved: their names, and the bytes that they write per pixel.
fn passes_and_bytes(headless: &mut Headless, camera: Entity) -> Vec<(&'static str, u32)> {
    headless.app.world_mut().get_mut::<Transform>(camera).unwrap().translation.x += 0.01;
    headless.update();
    let view = view(headless);
    assert_eq!(view.cached.first_drawn(), 0);
    view.passes.iter().map(|pass| (pass.name, written(pass))).collect()
}

/// Returns the bytes that a pass writes to a pixel, if it writes to all of its attachments.
fn written(pass: &Pass) -> u32 {
    // The target has four bytes of color.
    let bytes = |slot: &Slot| slot.format().and_then(|format| format.block_copy_size(None)).unwrap_or(4);
    let depth = pass.depth.iter().filter(|_| pass.writes_depth());
    pass.writes.iter().chain(depth).map(bytes).sum()
}

/// Besides those of the filter. `docs/performance.md` lists them.
#[test]
fn views_of_one_prop_have_few_passes_that_write_few_bytes() {
    let (mut headless, camera) = app(None, |_| ());
    let smooth = [volume::VOLUME, labels::COMPOSITE, edges::COVERAGE, labels::LABEL, labels::FINISH, labels::PRESENT];
    for (what, posterize, most, expected) in [
        ("as trained", None, 28, vec![volume::VOLUME, labels::LABEL, labels::PRESENT]),
        ("hard edges", Some(hard()), 176, vec![volume::VOLUME, labels::COMPOSITE, labels::LABEL, labels::PRESENT]),
        ("as in the paper", Some(Posterize::paper()), 190, smooth.to_vec()),
        ("posterized", Some(Posterize::default()), 98, smooth.to_vec()),
    ] {
        posterize_all(&mut headless, posterize);
        let mut passes = passes_and_bytes(&mut headless, camera);
        passes.iter().for_each(|(name, bytes)| println!("{what}: {name} {bytes} bytes per pixel"));
        let total: u32 = passes.iter().map(|(_, bytes)| bytes).sum();
        println!("{what}: {total} bytes per pixel");
        assert!(total <= most, "{what}: {total} bytes per pixel");
        passes.retain(|(name, _)| *name != labels::FILTER);
        assert_eq!(passes.into_iter().map(|(name, _)| name).collect::<Vec<_>>(), expected, "{what}");
    }
}

/// While pipelines for new settings are compiled, a posterized view stays posterized, also without props.
#[test]
fn posterized_views_without_props_are_held() {
    let (mut headless, camera) = app(None, |_| ());
    let world = headless.app.world_mut();
    let prop = world.query_filtered::<Entity, With<Prop>>().single(world).unwrap();
    let field = world.get::<Prop>(prop).unwrap().0.clone();
    let view_posterize = |iterations: u32| {
        let filter = BilateralFilter { iterations, ..default() };
        (PosterizeView(field.clone()), Posterize { filter, ..hard() })
    };
    world.entity_mut(camera).insert(view_posterize(0));
    world.entity_mut(prop).insert(Visibility::Hidden);
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    headless.app.world_mut().entity_mut(camera).insert(view_posterize(1));
    for frame in 0..6 {
        headless.update();
        assert!(view(&mut headless).plan.posterizes_view, "frame {frame}");
    }
}

/// Where a later pass replaces what a pass reads, that is written again whenever the pass is drawn.
#[test]
fn what_later_passes_replace_is_written_again_for_those_that_read_it() {
    let (mut headless, _) = app(None, |_| ());
    for (posterize, overlaps) in
        [(Posterize::default(), false), (Posterize::default(), true), (Posterize::paper(), true), (hard(), true)]
    {
        let world = headless.app.world_mut();
        if let (true, Ok(field)) = (overlaps, world.query::<&Prop>().single(world).cloned()) {
            world.spawn((field, Transform::from_xyz(0.2, 0.1, 0.0)));
        }
        posterize_all(&mut headless, Some(posterize));
        let PropView { passes, plan, .. } = view(&mut headless);
        assert_eq!(plan.overlaps, overlaps);
        // Whenever a result is drawn, so are all later ones, and all passes without one.
        let result = |pass: &Pass| pass.result.map_or(CachedResult::ALL.len(), |result| result as usize);
        for (index, pass) in passes.iter().enumerate() {
            for slot in pass.reads.iter().flatten() {
                let writes = |other: &&Pass| other.writes.contains(slot) || other.stores.contains(slot);
                if passes[index + 1..].iter().any(|other| writes(&other)) {
                    let writer = passes[..index].iter().rfind(writes).unwrap();
                    assert!(result(writer) >= result(pass), "{}, {slot:?}", pass.name);
                }
            }
        }
    }
}

/// Lets each pipeline be ready a few frames after it was requested, as if it were compiled in the background. `seed`
/// decides how many.
fn compile_in_background(headless: &mut Headless, seed: u32) {
    let world = headless.app.sub_app(RenderApp).world();
    let mut frames: HashMap<_, _> = world.resource::<Pipelines>().requested().map(|id| (id, 0)).collect();
    let hold_back = move |mut pipelines: ResMut<Pipelines>| {
        let requested: Vec<_> = pipelines.requested().collect();
        for id in requested {
            let left = frames.entry(id).or_insert_with(|| FixedHasher.hash_one((seed, id)) % 6);
            if *left > 0 {
                pipelines.held_back.insert(id);
                *left -= 1;
            } else {
                pipelines.held_back.remove(&id);
            }
        }
    };
    let before = hold_back.before(PlenOctreeRenderSystems::PlanViews);
    headless.app.sub_app_mut(RenderApp).add_systems(Render, before);
}

/// Returns how many props a frame draws.
fn drawn_props(headless: &mut Headless) -> usize {
    let volume = view(headless).passes.iter().filter(|pass| pass.name == "plenoctree_volume");
    let props: HashSet<_> = volume.flat_map(|pass| &pass.draws).map(|draw| draw.instance & 0xffff).collect();
    props.len()
}

/// Returns whether a frame leaves out nothing.
fn is_complete(headless: &mut Headless) -> bool {
    view(headless).left_out == LeftOut::Nothing
}

/// Returns what a frame shows that must not go while pipelines are compiled.
fn features(headless: &mut Headless) -> HashSet<&'static str> {
    let plan = &view(headless).plan;
    let all = [
        ("overlaps", plan.overlaps),
        ("colors", plan.props.iter().any(|prop| prop.kind.may_recolor)),
        ("fog", plan.keeps(Feature::Fog)),
        ("labels", plan.keeps(Feature::Posterize)),
        ("light", plan.keeps(Feature::Lighting)),
        ("objects", plan.keeps(Feature::Objects)),
        ("edges", plan.keeps(Feature::Edges)),
        ("sparse", plan.keeps(Feature::Sparse)),
        ("finish", plan.keeps(Feature::Finish)),
    ];
    all.into_iter().filter(|(_, is_shown)| *is_shown).map(|(what, _)| what).collect()
}

/// Returns an app with two props, the first of which overlaps neither the other nor a third one, which is hidden. Returns
/// the props and the camera.
#[cfg(feature = "headless-lit")]
fn app_of_props() -> (Headless, [Entity; 4]) {
    let (mut headless, camera) = app(None, lit);
    let world = headless.app.world_mut();
    let first = world.query_filtered::<Entity, With<Prop>>().single(world).unwrap();
    let field = world.get::<Prop>(first).unwrap().clone();
    let second = world.spawn((field, Transform::from_xyz(1.2, 0.0, 0.0))).id();
    let other = world.resource_mut::<Assets<PlenOctree>>().add(cube(Basis::Sh4, DVec3::new(0.2, 0.6, 0.3)));
    let palette = FieldPalette::from_colors([Color::BLACK, Color::WHITE]).unwrap();
    world.resource_mut::<Palettes>().insert(&other, palette);
    let third = world.spawn((Prop(other), Transform::from_xyz(-1.2, 0.4, 0.0), Visibility::Hidden)).id();
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    assert_eq!(drawn_props(&mut headless), 2);
    (headless, [first, second, third, camera])
}

/// A change to the world of [`app_of_props`].
#[cfg(feature = "headless-lit")]
type Change = fn(&mut World, [Entity; 4]);

/// Changes that need other pipelines.
#[cfg(feature = "headless-lit")]
const CHANGES: &[(&str, Change)] = &[
    ("overlaps", |world, [_, second, ..]| {
        world.entity_mut(second).insert(Transform::from_xyz(0.2, 0.0, 0.8));
    }),
    ("colors", |world, [_, second, ..]| {
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
    ("ink", |world, [first, ..]| _ = world.entity_mut(first).insert(Ink::default())),
    ("quality", |world, [.., camera]| _ = world.entity_mut(camera).insert(PropQuality::EXACT)),
    ("tonemapping", |world, [.., camera]| {
        world.entity_mut(camera).insert(bevy::core_pipeline::tonemapping::Tonemapping::Reinhard);
    }),
    ("filter", |world, [first, ..]| {
        let filter = BilateralFilter { iterations: 0, ..default() };
        world.entity_mut(first).insert(Posterize { filter, ..default() });
    }),
    ("soft labels", |world, [first, ..]| _ = world.entity_mut(first).insert(Posterize::soft())),
    ("brightness", |world, [first, ..]| _ = world.entity_mut(first).insert(crate::PropLighting::default())),
    ("no ink", |world, [first, ..]| _ = world.entity_mut(first).remove::<Ink>()),
    ("hard edges", |world, [first, ..]| _ = world.entity_mut(first).insert(hard())),
    ("no light", |world, [first, ..]| _ = world.entity_mut(first).remove::<crate::PropLighting>()),
    ("other labels", |world, [first, second, ..]| {
        world.entity_mut(first).remove::<Posterize>();
        world.entity_mut(second).insert(Posterize::default());
    }),
    ("no labels", |world, [_, second, ..]| _ = world.entity_mut(second).remove::<Posterize>()),
    ("no fog", |world, [.., camera]| _ = world.entity_mut(camera).remove::<bevy::pbr::DistanceFog>()),
    ("labels again", |world, [first, ..]| _ = world.entity_mut(first).insert(Posterize::default())),
    ("another field", |world, [.., third, _]| _ = world.entity_mut(third).insert(Visibility::Visible)),
    ("its labels", |world, [.., third, _]| _ = world.entity_mut(third).insert(Posterize::comic())),
    ("apart", |world, [_, second, ..]| {
        world.entity_mut(second).insert(Transform::from_xyz(1.2, 0.0, 0.0));
    }),
    ("fewer rays", |world, [.., camera]| _ = world.entity_mut(camera).insert(PropQuality::BALANCED)),
    ("a new field", |world, [.., third, _]| {
        let mut fields = world.resource_mut::<Assets<PlenOctree>>();
        let basis = [Basis::Sh1, Basis::Sh9, Basis::Sh16][fields.len() % 3];
        let field = fields.add(cube(basis, DVec3::new(0.2, 0.3, 0.7)));
        let palette = FieldPalette::from_colors([Color::BLACK, Color::WHITE]).unwrap();
        world.resource_mut::<Palettes>().insert(&field, palette);
        world.entity_mut(third).insert((Prop(field), Visibility::Visible));
    }),
    ("gone", |world, [.., third, _]| _ = world.entity_mut(third).insert(Visibility::Hidden)),
];

/// Props that are drawn stay while pipelines are compiled for what is new: another prop before them, labels, colors,
/// fog, light, transparent objects, and other settings of these. So does what they show.
#[test]
#[cfg(feature = "headless-lit")]
fn props_stay_while_pipelines_are_compiled() {
    let (mut headless, entities) = app_of_props();
    let objects: Change = |world, _| {
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::default());
        let material = StandardMaterial { alpha_mode: AlphaMode::Blend, ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(0.0, 0.0, 1.5)));
    };
    for (what, change) in CHANGES.iter().chain(&[("objects", objects)]) {
        if *what == "objects" {
            headless.app.world_mut().entity_mut(entities[3]).insert(PropPlacement::Display);
            headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        }
        let mut frames = vec![features(&mut headless)];
        change(headless.app.world_mut(), entities);
        while frames.len() < 6 || !is_complete(&mut headless) {
            headless.update();
            assert!(drawn_props(&mut headless) >= 2, "{what}, frame {}", frames.len());
            frames.push(features(&mut headless));
        }
        // What is there before and after is there in between.
        let stays = frames[0].intersection(&frames[frames.len() - 1]).copied().collect();
        for (index, features) in frames.iter().enumerate() {
            assert!(features.is_superset(&stays), "{what}, frame {index}: {features:?}, expected {stays:?}");
        }
    }
}

/// However long each pipeline takes, and whatever changes in the meantime. In the end, views look like those of an app
/// whose pipelines are compiled at once.
#[test]
#[cfg(feature = "headless-lit")]
fn nothing_goes_whichever_pipelines_are_compiled_first() {
    for seed in 0..(ProptestConfig::default().cases / 32).max(1) {
        let (mut at_once, entities) = app_of_props();
        let (mut headless, same) = app_of_props();
        assert_eq!(entities, same);
        compile_in_background(&mut headless, seed);
        let mut history = vec![];
        for index in 0..24 {
            let random = FixedHasher.hash_one((seed, index));
            let (what, change) = CHANGES[random as usize % CHANGES.len()];
            history.push(what);
            change(at_once.app.world_mut(), entities);
            change(headless.app.world_mut(), entities);
            at_once.wait_until_ready(Duration::from_secs(120)).unwrap();
            let wanted = (features(&mut at_once), drawn_props(&mut at_once));
            for frame in 0..random / 64 % 5 {
                let before = (features(&mut headless), drawn_props(&mut headless));
                headless.update();
                let now = (features(&mut headless), drawn_props(&mut headless));
                let stays: HashSet<_> = before.0.intersection(&wanted.0).copied().collect();
                let context = || format!("frame {frame} of {history:?}: {before:?}, {now:?}, expected {wanted:?}");
                assert!(now.0.is_superset(&stays) && now.1 >= before.1.min(wanted.1), "{}", context());
            }
        }
        headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        assert!(features(&mut headless) == features(&mut at_once), "{history:?}");
        assert!(headless.capture().unwrap() == at_once.capture().unwrap(), "{history:?}");
    }
}

/// So does a posterized prop that is given fields of other shapes, when their palettes arrive. So do its smooth edges.
#[test]
fn props_stay_when_the_palette_of_another_field_arrives() {
    let (mut headless, camera) = app(Some(Posterize::default()), |_| ());
    headless.app.world_mut().entity_mut(camera).insert(PropQuality::BALANCED);
    let world = headless.app.world_mut();
    let mut fields = world.resource_mut::<Assets<PlenOctree>>();
    let fields = [Basis::Sh4, Basis::Sh9].map(|basis| fields.add(cube(basis, DVec3::new(0.2, 0.6, 0.3))));
    // The second one arrives before anything shows it.
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    let shown = features(&mut headless);
    assert!(shown.contains("edges") && shown.contains("sparse"));
    for field in fields {
        let world = headless.app.world_mut();
        let mut props = world.query::<&mut Prop>();
        props.single_mut(world).unwrap().0 = field.clone();
        let mut frames = 0;
        while frames < 10 {
            headless.update();
            assert_eq!(drawn_props(&mut headless), 1);
            assert_eq!(features(&mut headless), shown);
            let is_known = headless.app.world().resource::<Palettes>().get(&field).is_some();
            frames += u32::from(is_known && is_complete(&mut headless));
        }
    }
}

/// A prop draws the batches that may have pixels of it, no matter how large others are, and none out of view.
#[test]
fn props_draw_the_batches_around_them() {
    let (mut headless, camera) = app(None, |_| ());
    headless.resize(UVec2::new(500, 310));
    let world = headless.app.world_mut();
    world.entity_mut(camera).insert(PropQuality::FAST);
    let field = world.query::<&Prop>().single(world).unwrap().clone();
    let place = |x| Transform::from_xyz(x, 0.0, 0.6).with_scale(Vec3::splat(0.05));
    world.spawn((field.clone(), place(0.3)));
    world.spawn((field, place(100.0), NoFrustumCulling));
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    passes_and_bytes(&mut headless, camera);
    let drawn = |pass: &&Pass| pass.name == volume::VOLUME_BATCHES;
    let view = view(&mut headless);
    let mut batches: Vec<u32> =
        view.passes.iter().filter(drawn).flat_map(|pass| &pass.draws).map(|draw| draw.vertices.end / 6).collect();
    batches.sort_unstable();
    batches.dedup();
    assert_eq!(view.plan.props.len(), 3);
    // It covers about 9 x 9 pixels, and the large one 140 x 140.
    let [small, large] = batches[..] else { panic!("{batches:?}") };
    assert!((1..=4).contains(&small) && (64..=144).contains(&large), "{batches:?}");
}

/// Returns the bytes of GPU memory that a view of this size takes at rest, from a distance.
fn bytes((headless, camera): &mut (Headless, Entity), size: UVec2, distance: f32) -> u64 {
    headless.resize(size);
    headless.app.world_mut().get_mut::<Transform>(*camera).unwrap().translation.z = distance;
    // Textures of earlier frames are kept for a few frames.
    (0..12).for_each(|_| headless.update());
    let view = view(headless);
    assert_ne!(view.cached.first_drawn(), 0);
    view.textures.bytes() + view.cached.bytes()
}

/// Textures are as large as what the prop covers.
#[test]
fn small_props_take_little_memory_and_large_ones_what_their_pixels_need() {
    let kinds = [
        ("as trained", None, 20.5),
        ("hard edges", Some(hard()), 57.0),
        ("smooth edges", Some(Posterize::paper()), 91.13),
        ("smooth edges and borders", Some(Posterize { steadiness: 0.0, ..default() }), 95.13),
        // What is known of the former frame has a single pixel.
        ("steady labels", Some(Posterize::default()), 95.131),
    ];
    let mut view = app(None, |_| ());
    for (what, posterize, most) in kinds {
        posterize_all(&mut view.0, posterize);
        let size = UVec2::new(512, 320);
        let filled = bytes(&mut view, size, 0.7) as f64 / f64::from(size.element_product());
        println!("{what}: {filled} bytes per pixel");
        assert!(filled <= most, "{what}: {filled} bytes per pixel");
        // In a view of 1920 x 1080 pixels, it covers about 64 x 64.
        let small = bytes(&mut view, UVec2::new(1920, 1080), 20.5);
        println!("{what}, 64 pixels of 1920: {small} bytes");
        assert!((64 * 64..8 << 20).contains(&small), "{what}: {small} bytes");
    }
}

/// Views hold the labels and the depth of the former frame while they keep labels.
#[test]
fn former_frames_are_held_while_labels_are_kept() {
    let (mut headless, camera) = app(Some(Posterize::default()), |_| ());
    let held = |headless: &mut Headless| view(headless).textures.bytes();
    (0..6).for_each(|_| headless.update());
    let at_rest = held(&mut headless);
    headless.app.world_mut().get_mut::<Transform>(camera).unwrap().translation.x += 0.01;
    headless.update();
    assert_eq!(held(&mut headless), at_rest + 8 * (64 * 64 - 1));
    (0..12).for_each(|_| headless.update());
    assert_eq!(held(&mut headless), at_rest);
}

/// All results are cached.
const NONE: u32 = CachedResult::ALL.len() as u32;

/// A view in which nothing moves is not drawn again. If only the palette changes, no ray is traced and nothing is
/// filtered.
#[test]
fn still_views_draw_nothing_and_recoloring_draws_labels() {
    let (mut headless, _) = app(Some(Posterize::default()), |_| ());
    let first_drawn = |headless: &mut Headless| view(headless).cached.first_drawn();
    (0..6).for_each(|_| headless.update());
    assert_eq!(first_drawn(&mut headless), NONE);
    let world = headless.app.world_mut();
    let field = world.query::<&Prop>().single(world).unwrap().0.clone();
    world.resource_mut::<Palettes>().get_mut(&field).unwrap().set(0, Color::srgb(0.2, 0.4, 0.6));
    headless.update();
    assert_eq!(first_drawn(&mut headless), CachedResult::Labels as u32);
}

/// Nor are labels where light falls on them and stays as it is.
#[cfg(feature = "headless-lit")]
#[test]
fn still_views_in_light_draw_no_labels() {
    let (mut headless, _) = app(Some(Posterize::default()), lit);
    let world = headless.app.world_mut();
    let prop = world.query_filtered::<Entity, With<Prop>>().single(world).unwrap();
    world.entity_mut(prop).insert(crate::PropLighting::default());
    headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    (0..6).for_each(|_| headless.update());
    let view = view(&mut headless);
    assert!(view.plan.is_lit);
    assert_eq!(view.cached.first_drawn(), NONE);
}
