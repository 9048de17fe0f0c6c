//! Tests what apps can know of their props, what is drawn until they are ready, and what `Headless` waits for.

use std::time::{Duration, Instant};

use bevy::{
    prelude::*,
    render::{
        RenderApp,
        render_resource::{BufferDescriptor, BufferUsages},
        renderer::RenderDevice,
    },
};
use bevy_plenoctree::{
    BeforePalette, BilateralFilter, ColorCount, FieldPalette, FieldReady, Palette, PaletteExtraction, PaletteFailed,
    Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropError, PropQuality, PropState,
    headless::{Headless, HeadlessError, LitMeshPlugins, exact_camera},
    props_ready,
};
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

const PATIENCE: Duration = Duration::from_secs(120);
const RED: [u8; 3] = [204, 51, 51];
const BLUE: [u8; 3] = [26, 26, 153];
const NOTHING: [u8; 3] = [0; 3];

fn encoded(color: [u8; 3]) -> [f64; 3] {
    color.map(|channel| f64::from(channel) / 255.0)
}

/// Bakes the solid cube from -0.5 to 0.5.
fn cube(color: [u8; 3]) -> PlenOctree {
    cube_of(3, color)
}

fn cube_of(depth: u32, color: [u8; 3]) -> PlenOctree {
    let settings = BakeSettings { depth, density_samples: 1, basis: Basis::Rgba, ..default() };
    let color = DVec3::from(encoded(color));
    bake(&settings, |at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 }, |_| move |_| color).unwrap()
}

fn app(configure: impl FnOnce(&mut App)) -> Headless {
    let mut headless = Headless::new(UVec2::splat(16), |app| {
        app.add_plugins(PlenOctreePlugin);
        configure(app);
    })
    .unwrap();
    let camera = (exact_camera(Color::BLACK), headless.target(), Transform::from_xyz(0.0, 0.0, 3.0));
    headless.app.world_mut().spawn(camera);
    headless
}

fn add<A: Asset>(headless: &mut Headless, asset: A) -> Handle<A> {
    headless.app.world_mut().resource_mut::<Assets<A>>().add(asset)
}

/// Returns a handle whose asset arrives later.
fn reserve<A: Asset>(headless: &Headless) -> Handle<A> {
    headless.app.world().resource::<Assets<A>>().reserve_handle()
}

fn arrive<A: Asset>(headless: &mut Headless, handle: &Handle<A>, asset: A) {
    headless.app.world_mut().resource_mut::<Assets<A>>().insert(handle.id(), asset).unwrap();
}

fn posterize() -> Posterize {
    Posterize { filter: BilateralFilter { iterations: 0, ..default() }, ..default() }
}

/// Captures the next frame and returns the color in its middle.
fn middle(headless: &mut Headless) -> [u8; 3] {
    let [r, g, b, _] = headless.capture().unwrap().get_pixel(8, 8).0;
    [r, g, b]
}

fn state(headless: &Headless, prop: Entity) -> PropState {
    headless.app.world().get::<PropState>(prop).unwrap().clone()
}

/// Whether every prop is ready, as systems see it.
fn all_ready(headless: &mut Headless) -> bool {
    headless.app.world_mut().run_system_cached(props_ready).unwrap()
}

#[test]
fn posterized_props_wait_for_their_palettes() {
    let mut headless = app(|_| {});
    let field = add(&mut headless, cube(RED));
    let palette = reserve::<Palette>(&headless);
    let world = headless.app.world_mut();
    world.resource_mut::<Palettes>().insert_handle(&field, palette.clone());
    let prop = world.spawn((Prop(field), posterize())).id();
    for _ in 0..5 {
        assert_eq!(middle(&mut headless), NOTHING);
        assert!(!all_ready(&mut headless));
    }
    assert_eq!(state(&headless, prop), PropState::AwaitingPalette);

    let as_trained = Posterize { before_palette: BeforePalette::AsTrained, ..posterize() };
    headless.app.world_mut().entity_mut(prop).insert(as_trained);
    assert_eq!(middle(&mut headless), RED);
    assert_eq!(state(&headless, prop), PropState::AwaitingPalette);
    headless.app.world_mut().entity_mut(prop).insert(posterize());
    assert_eq!(middle(&mut headless), NOTHING);

    // When the palette arrives, the prop is posterized from the first frame on, and ready soon.
    arrive(&mut headless, &palette, Palette::new(vec![encoded(BLUE)]).unwrap());
    let frames: Vec<_> = (0..6).map(|_| (middle(&mut headless), state(&headless, prop))).collect();
    assert!(frames.iter().all(|(color, _)| [NOTHING, BLUE].contains(color)), "{frames:?}");
    assert!(frames.iter().all(|(color, state)| *state != PropState::Ready || *color == BLUE), "{frames:?}");
    assert_eq!(frames.last().unwrap(), &(BLUE, PropState::Ready));
    assert!(all_ready(&mut headless));
}

/// A prop that is given another field shows the one that it had, in its colors, until the new one can be drawn. Nothing
/// holds the old field from then on.
#[test]
fn a_prop_keeps_its_field_until_the_next_one_can_be_drawn() {
    let mut headless = app(|_| {});
    let (first, second) = (add(&mut headless, cube(RED)), reserve::<PlenOctree>(&headless));
    let palette = reserve::<Palette>(&headless);
    let world = headless.app.world_mut();
    let mut palettes = world.resource_mut::<Palettes>();
    palettes.insert(&first, FieldPalette::new(Palette::new(vec![encoded(RED)]).unwrap()));
    palettes.insert_handle(&second, palette.clone());
    let old = first.id();
    let prop = world.spawn((Prop(first), posterize())).id();
    headless.wait_until_ready(PATIENCE).unwrap();
    assert_eq!(middle(&mut headless), RED);

    headless.app.world_mut().get_mut::<Prop>(prop).unwrap().0 = second.clone();
    for _ in 0..4 {
        assert_eq!(middle(&mut headless), RED, "before the field is loaded");
    }
    assert_eq!(state(&headless, prop), PropState::Loading);
    arrive(&mut headless, &second, cube(BLUE));
    for _ in 0..4 {
        assert_eq!(middle(&mut headless), RED, "before the palette is known");
    }
    assert_eq!(state(&headless, prop), PropState::AwaitingPalette);
    arrive(&mut headless, &palette, Palette::new(vec![encoded(BLUE)]).unwrap());
    let frames: Vec<_> = (0..6).map(|_| middle(&mut headless)).collect();
    assert!(frames.iter().all(|color| [RED, BLUE].contains(color)), "{frames:?}");
    assert_eq!(*frames.last().unwrap(), BLUE);
    assert_eq!(state(&headless, prop), PropState::Ready);
    assert!(!headless.app.world().resource::<Assets<PlenOctree>>().contains(old));

    // A prop that is removed lets go of its field as well.
    headless.app.world_mut().entity_mut(prop).remove::<Prop>();
    let new = second.id();
    drop(second);
    (0..3).for_each(|_| headless.update());
    assert!(!headless.app.world().resource::<Assets<PlenOctree>>().contains(new));
}

/// A prop that no camera sees becomes ready too, and loading screens end although a prop has failed.
#[test]
fn states_follow_loading() {
    #[derive(Resource, Default)]
    struct Ended(bool);
    fn end(mut ended: ResMut<Ended>) {
        ended.0 = true;
    }
    let mut headless = app(|app| {
        app.init_resource::<Ended>().add_systems(Update, end.run_if(props_ready));
    });
    let field = reserve::<PlenOctree>(&headless);
    let world = headless.app.world_mut();
    let missing = world.resource::<AssetServer>().load::<PlenOctree>("missing.npz");
    let prop = world.spawn((Prop(field.clone()), Visibility::Hidden)).id();
    let failing = world.spawn(Prop(missing)).id();
    let start = Instant::now();
    while state(&headless, failing).is_waiting() {
        headless.update();
        assert!(start.elapsed() < PATIENCE);
    }
    let PropState::Failed(PropError::Load(error)) = state(&headless, failing) else { panic!() };
    assert!(error.contains("missing.npz"), "{error}");
    assert_eq!(state(&headless, prop), PropState::Loading);
    assert!(!headless.app.world().resource::<Ended>().0);

    arrive(&mut headless, &field, cube(RED));
    (0..4).for_each(|_| headless.update());
    assert_eq!(state(&headless, prop), PropState::Ready);
    assert!(headless.app.world().resource::<Ended>().0);
    let ready: Vec<_> =
        headless.app.world().resource::<Messages<FieldReady>>().iter_current_update_messages().collect();
    assert!(ready.iter().all(|ready| ready.field == field.id()));
}

/// Without a renderer, as on a server, there is no GPU to wait for.
#[test]
fn without_a_renderer_props_wait_for_their_fields_alone() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    let field = app.world_mut().resource_mut::<Assets<PlenOctree>>().add(cube(RED));
    let prop = app.world_mut().spawn(Prop(field)).id();
    app.update();
    assert_eq!(app.world().get::<PropState>(prop), Some(&PropState::Ready));
}

/// After an error of the GPU, Bevy stops rendering. What is captured then is no picture, but an error that says why.
#[test]
fn errors_of_the_gpu_are_reported() {
    let mut headless = app(|_| ());
    headless.capture().unwrap();
    let device = headless.app.sub_app(RenderApp).world().resource::<RenderDevice>();
    let usage = BufferUsages::empty();
    device.create_buffer(&BufferDescriptor { label: Some("odd one"), size: 4, usage, mapped_at_creation: false });
    for error in [headless.capture().unwrap_err(), headless.wait_until_ready(PATIENCE).unwrap_err()] {
        assert!(matches!(&error, HeadlessError::Rendering(reason) if reason.contains("odd one")), "{error}");
    }
}

#[derive(Resource, Default)]
struct Counted {
    startups: u32,
    frames: u32,
}

/// The first frame is a picture with everything that is there, lit meshes included, and captures count as one frame
/// each, whatever they wait for.
#[test]
fn frames_are_pictures_and_are_counted() {
    let mut headless = Headless::new(UVec2::splat(32), |app| {
        app.add_plugins((LitMeshPlugins, PlenOctreePlugin))
            .init_resource::<Counted>()
            .add_systems(Startup, |mut counted: ResMut<Counted>| counted.startups += 1)
            .add_systems(Update, |mut counted: ResMut<Counted>| counted.frames += 1);
    })
    .unwrap();
    let count = |headless: &Headless| {
        let counted = headless.app.world().resource::<Counted>();
        [counted.startups, counted.frames]
    };
    assert_eq!(count(&headless), [0, 0]);
    let field = add(&mut headless, cube(RED));
    let mesh = add(&mut headless, Cuboid::from_length(1.0).into());
    let material = add(&mut headless, StandardMaterial::from(Color::WHITE));
    let target = headless.target();
    let world = headless.app.world_mut();
    world.spawn((Prop(field), Transform::from_xyz(-0.6, 0.0, 0.0)));
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(0.6, 0.0, 0.0)));
    world.spawn(DirectionalLight::default());
    let view = Transform::from_xyz(0.0, 0.0, 3.0);
    // A level that is made in the background, and looks like the field.
    let quality = PropQuality { density_threshold: 1e-3, ..default() };
    let camera = (exact_camera(Color::srgb(0.2, 0.4, 0.6)), target, view, quality);
    world.spawn(camera).insert((Msaa::Sample4, bevy::camera::Hdr));

    let first = headless.capture().unwrap();
    assert_eq!(count(&headless), [1, 1]);
    let at = |x, y| {
        let [r, g, b, a] = first.get_pixel(x, y).0;
        ([r, g, b], a)
    };
    assert_eq!(at(1, 1), ([51, 102, 153], 255), "background");
    let (prop, mesh) = (at(8, 16), at(24, 16));
    assert!((0..3).all(|c| prop.0[c].abs_diff(RED[c]) <= 1) && prop.1 == 255, "prop: {prop:?}");
    assert!(mesh.0.iter().all(|channel| *channel > 100) && mesh.0[0] == mesh.0[2], "lit mesh: {mesh:?}");

    headless.update();
    headless.update();
    assert_eq!(headless.capture().unwrap(), first);
    assert_eq!(count(&headless), [1, 4]);
}

#[test]
fn waiting_has_limits_and_says_for_what() {
    let mut headless = app(|_| {});
    let field = add(&mut headless, cube_of(7, RED));
    let palette = reserve::<Palette>(&headless);
    let world = headless.app.world_mut();
    world.resource_mut::<Palettes>().insert_handle(&field, palette);
    let prop = world.spawn((Prop(field), posterize())).id();
    let error = headless.wait_until_ready(Duration::from_secs(3)).unwrap_err();
    assert!(matches!(error, HeadlessError::TimedOut { .. }));
    assert!(error.to_string().ends_with("to get a palette"), "{error}");

    // Measuring how faint leaves are takes longer than a frame.
    let world = headless.app.world_mut();
    world.entity_mut(prop).remove::<Posterize>();
    let camera = world.query_filtered::<Entity, With<Camera3d>>().single(world).unwrap();
    headless.wait_until_ready(PATIENCE).unwrap();
    headless.app.world_mut().entity_mut(camera).insert(PropQuality { opacity_loss: 1e-6, ..default() });
    headless.time_limit = Duration::ZERO;
    let error = headless.capture().unwrap_err();
    assert!(error.to_string().contains("a level of field"), "{error}");
    headless.time_limit = PATIENCE;
    assert_eq!(middle(&mut headless), RED);
}

/// If no palette can be extracted, the prop is drawn as trained, and a palette that is inserted helps.
#[test]
fn a_palette_that_is_inserted_replaces_a_failed_extraction() {
    let mut headless = app(|app| {
        app.world_mut().resource_mut::<PaletteExtraction>().settings.colors = ColorCount::Fixed(0);
    });
    let field = add(&mut headless, cube(RED));
    let prop = headless.app.world_mut().spawn((Prop(field.clone()), posterize())).id();
    let error = headless.wait_until_ready(PATIENCE).unwrap_err();
    assert!(matches!(error, HeadlessError::Prop(PropError::Palette(_))), "{error}");
    assert!(matches!(state(&headless, prop), PropState::Failed(PropError::Palette(_))));
    assert_eq!(headless.app.world().resource::<Messages<PaletteFailed>>().len(), 1);
    assert_eq!(middle(&mut headless), RED);

    let palette = FieldPalette::new(Palette::new(vec![encoded(BLUE)]).unwrap());
    headless.app.world_mut().resource_mut::<Palettes>().insert(&field, palette);
    headless.wait_until_ready(PATIENCE).unwrap();
    assert_eq!(middle(&mut headless), BLUE);
    assert!(headless.app.world().resource::<PaletteExtraction>().error(&field).is_none());
    assert_eq!(state(&headless, prop), PropState::Ready);
}
