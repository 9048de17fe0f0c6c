//! Tests what apps can know of their props, what is drawn until they are ready, and what `Headless` waits for.

use std::time::Duration;

use bevy::{
    prelude::*,
    render::render_resource::{BufferDescriptor, BufferUsages, PipelineCache},
};
use bevy_plenoctree::{
    BeforePalette, BilateralFilter, ColorCount, DeviceRecoveryPlugin, EdgeSmoothing, FieldPalette, FieldReady, Palette,
    PaletteExtraction, PaletteFailed, PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop,
    PropError, PropQuality, PropState,
    headless::{HeadlessError, LitMeshPlugins},
    props_ready,
};
use half::f16;
use image::RgbaImage;
use plenoctree::Basis;

use super::stage::{
    PATIENCE, Stage,
    fields::{self, SOLID, colored, eight},
    pixels, wait_for,
};

const RED: [u8; 3] = [204, 51, 51];
const BLUE: [u8; 3] = [26, 26, 153];
const NOTHING: [u8; 3] = [0; 3];

fn encoded(color: [u8; 3]) -> [f64; 3] {
    color.map(|channel| f64::from(channel) / 255.0)
}

/// Bakes the solid cube from -0.5 to 0.5.
fn cube(color: [u8; 3]) -> PlenOctree {
    fields::cube(SOLID, encoded(color).into())
}

fn app(configure: impl FnOnce(&mut App)) -> Stage {
    let mut stage = Stage::with(UVec2::splat(16), configure);
    stage.set(Transform::from_xyz(0.0, 0.0, 3.0));
    stage
}

/// Returns a handle whose asset arrives later.
fn reserve<A: Asset>(stage: &Stage) -> Handle<A> {
    stage.resource::<Assets<A>>().reserve_handle()
}

fn arrive<A: Asset>(stage: &mut Stage, handle: &Handle<A>, asset: A) {
    stage.world().resource_mut::<Assets<A>>().insert(handle.id(), asset).unwrap();
}

fn posterize() -> Posterize {
    Posterize { filter: BilateralFilter { iterations: 0, ..default() }, ..default() }
}

/// Captures the next frame and returns the color in its middle.
fn middle(stage: &mut Stage) -> [u8; 3] {
    pixels::middle(&stage.capture())
}

fn state(stage: &Stage, prop: Entity) -> PropState {
    stage.get::<PropState>(prop).clone()
}

/// Whether every prop is ready, as systems see it.
fn all_ready(stage: &mut Stage) -> bool {
    stage.world().run_system_cached(props_ready).unwrap()
}

#[test]
fn posterized_props_wait_for_their_palettes() {
    let mut stage = app(|_| {});
    let field = stage.add(cube(RED));
    let palette = reserve::<Palette>(&stage);
    let world = stage.world();
    world.resource_mut::<Palettes>().insert_handle(&field, palette.clone());
    let prop = world.spawn((Prop(field), posterize())).id();
    for _ in 0..5 {
        assert_eq!(middle(&mut stage), NOTHING);
        assert!(!all_ready(&mut stage));
    }
    assert_eq!(state(&stage, prop), PropState::AwaitingPalette);

    let as_trained = Posterize { before_palette: BeforePalette::AsTrained, ..posterize() };
    stage.insert(prop, as_trained);
    assert_eq!(middle(&mut stage), RED);
    assert_eq!(state(&stage, prop), PropState::AwaitingPalette);
    stage.insert(prop, posterize());
    assert_eq!(middle(&mut stage), NOTHING);

    // When the palette arrives, the prop is posterized from the first frame on, and ready soon.
    arrive(&mut stage, &palette, Palette::new(vec![encoded(BLUE)]).unwrap());
    let frames: Vec<_> = (0..6).map(|_| (middle(&mut stage), state(&stage, prop))).collect();
    assert!(frames.iter().all(|(color, _)| [NOTHING, BLUE].contains(color)), "{frames:?}");
    assert!(frames.iter().all(|(color, state)| *state != PropState::Ready || *color == BLUE), "{frames:?}");
    assert_eq!(frames.last().unwrap(), &(BLUE, PropState::Ready));
    assert!(all_ready(&mut stage));
}

/// A prop that is given another field shows the one that it had, in its colors, until the new one can be drawn. Nothing
/// holds the old field from then on.
#[test]
fn a_prop_keeps_its_field_until_the_next_one_can_be_drawn() {
    let mut stage = app(|_| {});
    let (first, second) = (stage.add(cube(RED)), reserve::<PlenOctree>(&stage));
    let palette = reserve::<Palette>(&stage);
    let world = stage.world();
    let mut palettes = world.resource_mut::<Palettes>();
    palettes.insert(&first, FieldPalette::new(Palette::new(vec![encoded(RED)]).unwrap()));
    palettes.insert_handle(&second, palette.clone());
    let old = first.id();
    let prop = world.spawn((Prop(first), posterize())).id();
    stage.wait();
    assert_eq!(middle(&mut stage), RED);

    stage.world().get_mut::<Prop>(prop).unwrap().0 = second.clone();
    for _ in 0..4 {
        assert_eq!(middle(&mut stage), RED, "before the field is loaded");
    }
    assert_eq!(state(&stage, prop), PropState::Loading);
    arrive(&mut stage, &second, cube(BLUE));
    for _ in 0..4 {
        assert_eq!(middle(&mut stage), RED, "before the palette is known");
    }
    assert_eq!(state(&stage, prop), PropState::AwaitingPalette);
    arrive(&mut stage, &palette, Palette::new(vec![encoded(BLUE)]).unwrap());
    let frames: Vec<_> = (0..6).map(|_| middle(&mut stage)).collect();
    assert!(frames.iter().all(|color| [RED, BLUE].contains(color)), "{frames:?}");
    assert_eq!(*frames.last().unwrap(), BLUE);
    assert_eq!(state(&stage, prop), PropState::Ready);
    assert!(!stage.resource::<Assets<PlenOctree>>().contains(old));

    // A prop that is removed lets go of its field as well.
    stage.world().entity_mut(prop).remove::<Prop>();
    let new = second.id();
    drop(second);
    stage.update(3);
    assert!(!stage.resource::<Assets<PlenOctree>>().contains(new));
}

/// Overrides that are meant for the next field of a prop do not color the one that it keeps until then.
#[test]
fn a_field_that_is_kept_keeps_its_overrides() {
    let mut stage = app(|_| {});
    let (first, second) = (stage.add(cube(RED)), reserve::<PlenOctree>(&stage));
    for (field, color) in [(&first, RED), (&second, BLUE)] {
        let palette = FieldPalette::new(Palette::new(vec![encoded(color)]).unwrap());
        stage.world().resource_mut::<Palettes>().insert(field, palette);
    }
    let own = |[red, green, blue]: [u8; 3]| PaletteOverride::default().with(0, Color::srgb_u8(red, green, blue));
    let prop = stage.spawn((Prop(first.clone()), posterize(), own([0, 255, 0])));
    stage.wait();
    assert_eq!(middle(&mut stage), [0, 255, 0]);

    stage.insert(prop, (Prop(second.clone()), own([255, 255, 0])));
    for _ in 0..3 {
        assert_eq!(middle(&mut stage), [0, 255, 0]);
    }
    arrive(&mut stage, &second, cube(BLUE));
    stage.wait();
    assert_eq!(middle(&mut stage), [255, 255, 0]);
    // Nor do those that are removed with it.
    stage.world().entity_mut(prop).remove::<PaletteOverride>();
    assert_eq!(middle(&mut stage), BLUE);
    let third = reserve::<PlenOctree>(&stage);
    stage.insert(prop, (Prop(third), own([255, 255, 0])));
    assert_eq!(middle(&mut stage), BLUE);
}

/// The pipelines of a field that is loaded ahead are compiled before a prop shows it: the prop does not vanish
/// meanwhile.
#[test]
fn fields_that_no_prop_shows_have_pipelines() {
    let mut stage = app(|_| {});
    // A field of another shape.
    let ahead = stage.add(eight(Basis::Sh9, 1e4, &[f16::ZERO; 27]));
    let palette = FieldPalette::new(Palette::new(vec![encoded(BLUE)]).unwrap());
    stage.world().resource_mut::<Palettes>().insert(&ahead, palette);
    stage.update(8);
    // Smooth edges may follow.
    let prop = stage.spawn_prop(&cube(RED), Posterize { edges: EdgeSmoothing::Off, ..posterize() });
    stage.paint(FieldPalette::new(Palette::new(vec![encoded(RED)]).unwrap()));
    stage.wait();
    let pipelines = |stage: &Stage| stage.render_world().resource::<PipelineCache>().pipelines().count();
    let before = pipelines(&stage);
    stage.insert(prop, Prop(ahead));
    assert_eq!(middle(&mut stage), BLUE);
    assert_eq!(pipelines(&stage), before);
}

/// The levels of a packed field are not packed, so their pipelines are others: the prop is drawn as before until those
/// are compiled.
#[test]
fn props_stay_while_pipelines_of_their_levels_are_compiled() {
    let mut stage = Stage::new(64);
    stage.set((Transform::from_xyz(0.0, 0.0, 4.0), PropQuality::EXACT));
    stage.spawn_prop(&fields::included("robot"), ());
    stage.wait();
    let exact = stage.capture();
    stage.set(PropQuality { cell_size: 8.0, ..PropQuality::EXACT });
    let frames = stage.frames_until("the level", |frame| *frame != exact);
    let covered = |frame: &RgbaImage| frame.pixels().filter(|pixel| pixel.0[..3] != NOTHING).count();
    let least = frames.iter().map(covered).min().unwrap();
    assert!(least > covered(&exact) / 2, "{least} of {} pixels show the prop", covered(&exact));
}

/// A prop that no camera sees becomes ready too, and loading screens end although a prop has failed.
#[test]
fn states_follow_loading() {
    #[derive(Resource, Default)]
    struct Ended(bool);
    fn end(mut ended: ResMut<Ended>) {
        ended.0 = true;
    }
    let mut stage = app(|app| {
        app.init_resource::<Ended>().add_systems(Update, end.run_if(props_ready));
    });
    let field = reserve::<PlenOctree>(&stage);
    let world = stage.world();
    let missing = world.resource::<AssetServer>().load::<PlenOctree>("missing.npz");
    let prop = world.spawn((Prop(field.clone()), Visibility::Hidden)).id();
    let wrong = world.resource::<AssetServer>().load::<PlenOctree>("robot.palette.json");
    for (field, name) in [(missing, "missing.npz"), (wrong, "robot.palette.json")] {
        let failing = stage.world().spawn(Prop(field)).id();
        wait_for("a failure", || {
            stage.update(1);
            !state(&stage, failing).is_waiting()
        });
        let PropState::Failed(PropError::Load(error)) = state(&stage, failing) else { panic!() };
        // Bevy adds a backtrace to what loaders say.
        assert!(error.contains(name) && error.lines().count() == 1, "{error}");
    }
    assert_eq!(state(&stage, prop), PropState::Loading);
    assert!(!stage.resource::<Ended>().0);

    arrive(&mut stage, &field, cube(RED));
    stage.update(4);
    assert_eq!(state(&stage, prop), PropState::Ready);
    assert!(stage.resource::<Ended>().0);
    let ready: Vec<_> = stage.resource::<Messages<FieldReady>>().iter_current_update_messages().collect();
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
    for recovers in [false, true] {
        // Replaces devices, but hides no other error.
        let recover = |app: &mut App| _ = app.add_plugins(DeviceRecoveryPlugin);
        let mut stage = if recovers { app(recover) } else { app(|_| ()) };
        stage.capture();
        let device = stage.device();
        let usage = BufferUsages::empty();
        device.create_buffer(&BufferDescriptor { label: Some("odd one"), size: 4, usage, mapped_at_creation: false });
        for error in [stage.headless.capture().unwrap_err(), stage.headless.wait_until_ready(PATIENCE).unwrap_err()] {
            assert!(matches!(&error, HeadlessError::Rendering(reason) if reason.contains("odd one")), "{error}");
        }
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
    let mut stage = Stage::with(UVec2::splat(32), |app| {
        app.add_plugins(LitMeshPlugins)
            .init_resource::<Counted>()
            .add_systems(Startup, |mut counted: ResMut<Counted>| counted.startups += 1)
            .add_systems(Update, |mut counted: ResMut<Counted>| counted.frames += 1);
    });
    let count = |stage: &Stage| {
        let counted = stage.resource::<Counted>();
        [counted.startups, counted.frames]
    };
    assert_eq!(count(&stage), [0, 0]);
    stage.spawn_prop(&cube(RED), Transform::from_xyz(-0.6, 0.0, 0.0));
    stage.spawn_mesh(Cuboid::from_length(1.0), Color::WHITE.into(), Transform::from_xyz(0.6, 0.0, 0.0));
    stage.spawn(DirectionalLight::default());
    stage.set_background(Color::srgb(0.2, 0.4, 0.6));
    // A level that is made in the background, and looks like the field.
    stage.set((Transform::from_xyz(0.0, 0.0, 3.0), PropQuality { density_threshold: 1e-3, ..default() }));
    stage.set((Msaa::Sample4, bevy::camera::Hdr));

    let first = stage.capture();
    assert_eq!(count(&stage), [1, 1]);
    let at = |x, y| {
        let [r, g, b, a] = first.get_pixel(x, y).0;
        ([r, g, b], a)
    };
    assert_eq!(at(1, 1), ([51, 102, 153], 255), "background");
    let (prop, mesh) = (at(8, 16), at(24, 16));
    assert!((0..3).all(|c| prop.0[c].abs_diff(RED[c]) <= 1) && prop.1 == 255, "prop: {prop:?}");
    assert!(mesh.0.iter().all(|channel| *channel > 100) && mesh.0[0] == mesh.0[2], "lit mesh: {mesh:?}");

    stage.update(1);
    stage.update(1);
    assert_eq!(stage.capture(), first);
    assert_eq!(count(&stage), [1, 4]);
}

#[test]
fn waiting_has_limits_and_says_for_what() {
    let mut stage = app(|_| {});
    let large = colored(7, |at| if at.abs().max_element() < 0.5 { SOLID } else { 0.0 }, |_| encoded(RED).into());
    stage.spawn_prop(&large, ());
    stage.wait();
    let (field, palette) = (stage.field(), reserve::<Palette>(&stage));
    stage.world().resource_mut::<Palettes>().insert_handle(&field, palette);
    stage.dress(posterize());
    let error = stage.headless.wait_until_ready(Duration::ZERO).unwrap_err();
    assert!(matches!(error, HeadlessError::TimedOut { .. }));
    assert!(error.to_string().ends_with("to get a palette"), "{error}");

    // Measuring how faint leaves are takes longer than a frame.
    stage.undress::<Posterize>();
    stage.set(PropQuality { opacity_loss: 1e-6, ..default() });
    stage.headless.time_limit = Duration::ZERO;
    let error = stage.headless.capture().unwrap_err();
    assert!(error.to_string().contains("a level of field"), "{error}");
    stage.headless.time_limit = PATIENCE;
    assert_eq!(middle(&mut stage), RED);
}

/// If no palette can be extracted, the prop is drawn as trained, and a palette that is inserted helps.
#[test]
fn a_palette_that_is_inserted_replaces_a_failed_extraction() {
    let mut stage = app(|_| {});
    stage.world().resource_mut::<PaletteExtraction>().settings.colors = ColorCount::Fixed(0);
    let prop = stage.spawn_prop(&cube(RED), posterize());
    let field = stage.field();
    let error = stage.headless.wait_until_ready(PATIENCE).unwrap_err();
    assert!(matches!(error, HeadlessError::Prop(PropError::Palette(_))), "{error}");
    assert!(matches!(state(&stage, prop), PropState::Failed(PropError::Palette(_))));
    assert_eq!(stage.resource::<Messages<PaletteFailed>>().len(), 1);
    assert_eq!(middle(&mut stage), RED);

    let palette = FieldPalette::new(Palette::new(vec![encoded(BLUE)]).unwrap());
    stage.world().resource_mut::<Palettes>().insert(&field, palette);
    stage.wait();
    assert_eq!(middle(&mut stage), BLUE);
    assert!(stage.resource::<PaletteExtraction>().error(&field).is_none());
    assert_eq!(state(&stage, prop), PropState::Ready);
}
