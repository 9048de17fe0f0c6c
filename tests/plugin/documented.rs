//! Runs the code blocks of the README and the guide. The blocks are copied here word for word.

use std::{fs, path::Path};

use bevy::{prelude::*, render::RenderApp};
use bevy_plenoctree::prelude::*;
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

/// Bakes the solid cube from -0.5 to 0.5.
fn cube() -> PlenOctree {
    let settings = BakeSettings { depth: 3, basis: Basis::Rgba, ..default() };
    bake(&settings, |at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 }, |_| |_| DVec3::ONE).unwrap()
}

/// Creates an app without a renderer, with a posterized prop at the origin whose palette is white and black.
fn app(configure: impl FnOnce(&mut App)) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), TransformPlugin, PlenOctreePlugin));
    configure(&mut app);
    assert!(app.get_sub_app(RenderApp).is_none());
    let world = app.world_mut();
    let field = world.resource_mut::<Assets<PlenOctree>>().add(cube());
    let palette = FieldPalette::from_colors([Color::WHITE, Color::BLACK]).unwrap();
    world.resource_mut::<Palettes>().insert(&field, palette);
    world.spawn((Prop(field), Posterize::default(), InheritedVisibility::VISIBLE));
    app
}

fn prop(app: &mut App) -> Entity {
    app.world_mut().query_filtered::<Entity, With<Prop>>().single(app.world()).unwrap()
}

fn field(app: &mut App) -> Handle<PlenOctree> {
    app.world_mut().query::<&Prop>().single(app.world()).unwrap().0.clone()
}

/// Returns the shown colors of the only palette.
fn shown(app: &App) -> &[Color] {
    let (fields, palettes) = (app.world().resource::<Assets<PlenOctree>>(), app.world().resource::<Palettes>());
    fields.ids().find_map(|field| palettes.get(field)).unwrap().shown()
}

#[test]
fn every_system_of_the_documentation_runs() {
    getting_started::run();
    recoloring::run();
    settings::run();
    loading_screen::run();
    loading_bar::run();
    budget::run();
    recovery::run();
    animation::run();
    nightfall::run();
    saving::run();
    assigning::run();
    stages::run();
    casting::run();
    receiving::run();
    aiming::run();
    pointing::run();
}

/// The code in the documentation is the code that runs here, apart from line breaks.
#[test]
fn every_block_of_the_documentation_is_here() {
    let words = |text: &str| text.split_whitespace().collect::<String>();
    let here = words(include_str!("documented.rs"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let guide = fs::read_dir(root.join("docs/guide")).unwrap().map(|entry| entry.unwrap().path());
    let mut count = 0;
    for path in guide.chain([root.join("README.md")]) {
        let page = fs::read_to_string(&path).unwrap();
        let blocks = page.split("```rust").skip(1).filter_map(|rest| rest.split_once('\n')?.1.split("```").next());
        for block in blocks {
            count += 1;
            assert!(here.contains(&words(block)), "the tests do not run this block:\n{block}");
            // `cargo test --doc` compiles it.
            let name = path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
            assert!(include_str!("../../src/lib.rs").contains(&format!("include_str!(\"../{name}\")")), "{name}");
        }
    }
    assert!(count > 15);
}

#[allow(dead_code)]
mod getting_started {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    fn main() {
        App::new().add_plugins((DefaultPlugins, PlenOctreePlugin)).add_systems(Startup, setup).run();
    }

    fn setup(mut commands: Commands, assets: Res<AssetServer>) {
        commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::default()));
        commands.spawn((Camera3d::default(), Transform::from_xyz(1.5, 1.3, 3.2).looking_at(Vec3::ZERO, Vec3::Y)));
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Startup, setup));
        app.update();
        assert_eq!(app.world_mut().query::<(&Prop, &Posterize)>().iter(app.world()).count(), 2);
        assert_eq!(app.world_mut().query::<&Camera3d>().iter(app.world()).count(), 1);
    }
}

mod recoloring {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    fn recolor(props: Query<&Prop>, mut palettes: ResMut<Palettes>) {
        for prop in &props {
            if let Some(palette) = palettes.get_mut(&prop.0) {
                palette.set(0, Color::srgb(0.1, 0.3, 0.9));
            }
        }
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Update, recolor));
        app.update();
        assert_eq!(super::shown(&app)[0], Color::srgb(0.1, 0.3, 0.9));
    }
}

mod settings {
    use bevy::prelude::*;
    use bevy_plenoctree::{Activation, LoadSettings, UpAxis, prelude::*};

    fn setup(mut commands: Commands, assets: Res<AssetServer>) {
        let field = assets
            .load_builder()
            .with_settings(|settings: &mut LoadSettings| {
                settings.activation = Some(Activation::ShiftedRelu);
                settings.up = Some(UpAxis::Y);
            })
            .load("converted_from_svox2.npz");
        commands.spawn(Prop(field));
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Startup, setup));
        app.update();
        assert_eq!(app.world_mut().query::<&Prop>().iter(app.world()).count(), 2);
    }
}

mod loading_bar {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    #[derive(Component)]
    struct LoadingBar;

    fn show_progress(props: Query<&PropProgress>, mut bars: Query<&mut Transform, With<LoadingBar>>) {
        let shares = props.iter().map(PropProgress::fraction);
        let mean = shares.sum::<f32>() / props.iter().len().max(1) as f32;
        for mut bar in &mut bars {
            bar.scale.x = mean;
        }
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Update, show_progress));
        let bar = app.world_mut().spawn((LoadingBar, Transform::default())).id();
        let field = super::field(&mut app);
        let waiting = app.world_mut().spawn(Prop(Handle::default())).id();
        (0..2).for_each(|_| app.update());
        let shown = |app: &App| app.world().get::<Transform>(bar).unwrap().scale.x;
        assert_eq!(shown(&app), 0.5, "one of two props is waiting");
        app.world_mut().entity_mut(waiting).insert(Prop(field));
        (0..2).for_each(|_| app.update());
        assert_eq!(shown(&app), 1.0);
    }
}

mod budget {
    use std::time::Duration;

    use bevy::prelude::*;
    use bevy_plenoctree::UploadBudget;

    fn plugin(app: &mut App) {
        app.insert_resource(UploadBudget(Some(Duration::from_millis(4))));
    }

    pub fn run() {
        let app = super::app(|app| _ = app.add_plugins(plugin));
        assert_eq!(app.world().resource::<UploadBudget>().0, Some(Duration::from_millis(4)));
    }
}

mod loading_screen {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    #[derive(Component)]
    struct LoadingScreen;

    fn plugin(app: &mut App) {
        app.add_systems(Update, (report_failures, end_loading.run_if(props_ready)));
    }

    fn end_loading(mut commands: Commands, screens: Query<Entity, With<LoadingScreen>>) {
        for screen in &screens {
            commands.entity(screen).despawn();
        }
    }

    fn report_failures(props: Query<(&Prop, &PropState), Changed<PropState>>) {
        for (prop, state) in &props {
            if let PropState::Failed(error) = state {
                error!("{:?} is not drawn as it should be: {error}", prop.0.path());
            }
        }
    }

    pub fn run() {
        let mut app = super::app(plugin);
        let field = super::field(&mut app);
        app.world_mut().spawn(LoadingScreen);
        let waiting = app.world_mut().spawn(Prop(Handle::default())).id();
        app.update();
        let screens = |app: &mut App| app.world_mut().query::<&LoadingScreen>().iter(app.world()).count();
        assert_eq!(screens(&mut app), 1, "a prop is waiting");
        app.world_mut().entity_mut(waiting).insert(Prop(field));
        app.update();
        assert_eq!(screens(&mut app), 0);
    }
}

mod recovery {
    use bevy::prelude::*;
    use bevy_plenoctree::DeviceRecoveryPlugin;

    fn plugin(app: &mut App) {
        app.add_plugins(DeviceRecoveryPlugin);
    }

    pub fn run() {
        // Needs a renderer.
        bevy_plenoctree::headless::Headless::new(UVec2::ONE, plugin).unwrap().update();
    }
}

mod animation {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    #[derive(Component)]
    struct Night {
        progress: f32,
        colors: [Color; 6],
    }

    // Recolors all props of a field: from the source colors to others, in Oklab.
    fn day_to_night(mut palettes: ResMut<Palettes>, props: Query<(&Prop, &Night)>) {
        for (prop, night) in &props {
            if let Some(palette) = palettes.get_mut(&prop.0) {
                palette.blend_from_source(&night.colors, night.progress, BlendSpace::Oklab);
            }
        }
    }

    #[derive(Component)]
    struct Team(Color);

    // Recolors one entity. Colors that it does not override are still those of its field.
    fn team_colors(mut robots: Query<(&Team, &mut PaletteOverride)>) {
        for (team, mut colors) in &mut robots {
            colors.set(0, team.0);
        }
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Update, (day_to_night, team_colors)));
        let prop = super::prop(&mut app);
        let night = Night { progress: 1.0, colors: [Color::BLACK; 6] };
        app.world_mut().entity_mut(prop).insert((night, Team(Color::WHITE), PaletteOverride::default()));
        app.update();
        assert_eq!(super::shown(&app), [Color::BLACK; 2]);
        assert_eq!(app.world().get::<PaletteOverride>(prop).unwrap().get(0), Some(Color::WHITE));
    }
}

mod nightfall {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    fn fall_of_night(time: Res<Time>, mut tints: Query<&mut PropTint>) {
        let darkness = (time.elapsed_secs() / 60.0).min(1.0);
        for mut tint in &mut tints {
            tint.0 = Color::WHITE.mix(&Color::linear_rgb(0.02, 0.03, 0.1), darkness);
        }
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Update, fall_of_night));
        app.insert_resource(bevy::time::TimeUpdateStrategy::ManualDuration(std::time::Duration::from_secs(61)));
        // By default, the clock of games does not jump that far.
        app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(std::time::Duration::MAX);
        (0..2).for_each(|_| app.update());
        let prop = super::prop(&mut app);
        let tint = app.world().get::<PropTint>(prop).unwrap().0.to_linear();
        assert!((tint.to_vec3() - Vec3::new(0.02, 0.03, 0.1)).length() < 1e-3, "{tint:?}");
    }
}

mod saving {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    fn save(mut ready: MessageReader<PaletteReady>, palettes: Res<Palettes>) -> Result {
        for PaletteReady { field } in ready.read() {
            // Palettes that were loaded have no extraction. The path is a file system path, not an asset path.
            if let Some(palette) = palettes.get(*field).filter(|palette| palette.extraction().is_some()) {
                palette.save("assets/toadstool.palette.json")?;
            }
        }
        Ok(())
    }

    pub fn run() {
        // Does not save anything: the palette was not extracted.
        let mut app = super::app(|app| _ = app.add_systems(Update, save));
        let field = super::field(&mut app).id();
        app.world_mut().write_message(PaletteReady { field });
        app.update();
    }
}

mod assigning {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    #[derive(Component)]
    struct Winter;

    fn assign(props: Query<&Prop, Added<Winter>>, assets: Res<AssetServer>, mut palettes: ResMut<Palettes>) {
        for prop in &props {
            palettes.insert_handle(&prop.0, assets.load("winter.palette.json"));
        }
    }

    fn assign_colors(props: Query<&Prop, Added<Winter>>, mut palettes: ResMut<Palettes>) -> Result {
        for prop in &props {
            let colors = [Color::WHITE, Color::BLACK, Color::srgb(0.6, 0.8, 1.0)];
            palettes.insert(&prop.0, FieldPalette::from_colors(colors)?);
        }
        Ok(())
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Update, (assign, assign_colors).chain()));
        let prop = super::prop(&mut app);
        app.world_mut().entity_mut(prop).insert(Winter);
        app.update();
        assert_eq!(super::shown(&app).len(), 3);
    }
}

mod stages {
    use bevy::{camera::Hdr, prelude::*};
    use bevy_plenoctree::prelude::*;

    fn setup(mut commands: Commands, assets: Res<AssetServer>) {
        // Exact palette colors despite HDR, and a little accuracy traded for speed.
        commands.spawn((Camera3d::default(), Hdr, PropStage::Display, PropQuality::HIGH));
        // The whole view in one palette, including meshes and the sky.
        commands.spawn((Camera3d::default(), PosterizeView(assets.load("toadstool.plenoctree")), Posterize::default()));
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Startup, setup));
        app.update();
        assert_eq!(app.world_mut().query::<&Camera3d>().iter(app.world()).count(), 2);
        assert_eq!(app.world_mut().query::<(&PosterizeView, &Posterize)>().iter(app.world()).count(), 1);
    }
}

mod casting {
    use bevy::{light::NotShadowCaster, prelude::*};
    use bevy_plenoctree::prelude::*;

    fn setup(mut commands: Commands, assets: Res<AssetServer>) {
        commands.spawn(Prop(assets.load("toadstool.plenoctree")));
        commands.spawn((Prop(assets.load("ghost.npz")), NotShadowCaster));
        // Larger cells are faster, and the shadows coarser.
        let sun = DirectionalLight { shadow_maps_enabled: true, ..default() };
        commands.spawn((sun, PropQuality { cell_size: 2.0, ..PropQuality::EXACT }));
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Startup, setup));
        app.update();
        assert_eq!(app.world_mut().query::<(&Prop, &NotShadowCaster)>().iter(app.world()).count(), 1);
        assert_eq!(app.world_mut().query::<(&DirectionalLight, &PropQuality)>().iter(app.world()).count(), 1);
    }
}

mod receiving {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    fn setup(mut commands: Commands, assets: Res<AssetServer>) {
        let lighting = PropLighting { shadows: 0.6, tint: 0.3, bands: 2, ..default() };
        commands.spawn((Prop(assets.load("toadstool.plenoctree")), Posterize::default(), lighting));
    }

    pub fn run() {
        let mut app = super::app(|app| _ = app.add_systems(Startup, setup));
        app.update();
        assert_eq!(app.world_mut().query::<(&Prop, &PropLighting)>().iter(app.world()).count(), 1);
    }
}

mod aiming {
    use bevy::prelude::*;
    use bevy_plenoctree::prelude::*;

    fn plugin(app: &mut App) {
        app.add_systems(Update, aim.pipe(paint));
    }

    fn aim(cameras: Query<&GlobalTransform, With<Camera3d>>, ray_cast: PropRayCast) -> Option<PropHit> {
        let camera = cameras.iter().next()?;
        ray_cast.cast_ray(Ray3d::new(camera.translation(), camera.forward()))
    }

    // `PropRayCast` reads `Palettes`, so another system has to change them.
    fn paint(In(hit): In<Option<PropHit>>, props: Query<&Prop>, mut palettes: ResMut<Palettes>) {
        if let Some(hit) = hit
            && let (Some(label), Ok(prop)) = (hit.label, props.get(hit.entity))
            && let Some(palette) = palettes.get_mut(&prop.0)
        {
            palette.set(label.main_color(), Color::srgb(0.1, 0.3, 0.9));
        }
    }

    pub fn run() {
        let mut app = super::app(plugin);
        app.world_mut().spawn((Camera3d::default(), GlobalTransform::from_xyz(0.0, 0.0, 4.0)));
        app.update();
        assert_eq!(super::shown(&app)[0], Color::srgb(0.1, 0.3, 0.9));
    }
}

mod pointing {
    use bevy::prelude::*;
    use bevy_plenoctree::{PropPickingPlugin, prelude::*};

    fn plugin(app: &mut App) {
        app.add_plugins(PropPickingPlugin).add_systems(Startup, setup);
    }

    fn setup(mut commands: Commands, assets: Res<AssetServer>) {
        let prop = (Prop(assets.load("robot.plenoctree")), Posterize::default(), PaletteOverride::default());
        commands.spawn(prop).observe(recolor);
    }

    fn recolor(click: On<Pointer<Click>>, mut colors: Query<&mut PaletteOverride>) {
        let hit = click.hit.extra_as::<PropHit>();
        if let (Ok(mut colors), Some(label)) = (colors.get_mut(click.entity), hit.and_then(|hit| hit.label)) {
            colors.set(label.main_color(), Color::srgb(0.1, 0.3, 0.9));
        }
    }

    pub fn run() {
        // Needs windows and cameras.
        let mut headless = bevy_plenoctree::headless::Headless::new(UVec2::ONE, |app| {
            app.add_plugins((PlenOctreePlugin, bevy::picking::DefaultPickingPlugins));
            plugin(app);
        });
        headless.as_mut().unwrap().update();
        let world = headless.as_mut().unwrap().app.world_mut();
        assert_eq!(world.query::<(&Prop, &PaletteOverride)>().iter(world).count(), 1);
    }
}

#[allow(dead_code)]
mod capturing {
    use std::time::Duration;

    use bevy::prelude::*;
    use bevy_plenoctree::{
        headless::{Headless, exact_camera},
        prelude::*,
    };

    fn main() -> Result {
        let mut headless = Headless::new(UVec2::new(640, 480), |app| {
            app.add_plugins(PlenOctreePlugin);
        })?;
        let target = headless.target();
        let world = headless.app.world_mut();
        let field = world.resource::<AssetServer>().load("toadstool.plenoctree");
        let place = Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y);
        world.spawn((Prop(field), Posterize::default()));
        world.spawn((exact_camera(Color::WHITE), target, place));
        headless.wait_until_ready(Duration::from_secs(60))?;
        headless.capture()?.save("toadstool.png")?;
        Ok(())
    }
}
