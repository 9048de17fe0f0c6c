//! Tests that props come back whole from saved worlds, from scenes in code, and from the extras of glTF nodes.

use bevy::{
    camera::{primitives::Aabb, visibility::VisibilityClass},
    ecs::{entity::EntityHashMap, observer::ObservedBy, reflect::ReflectCommandExt, template::VecTemplate},
    gltf::GltfExtras,
    prelude::*,
    reflect::{TypeRegistry, serde::ReflectDeserializer},
    scene::ScenePlugin,
    world_serialization::{
        DynamicEntity,
        serde::{DynamicWorldSerializer, EntitySerializer, WorldDeserializer},
    },
};
use bevy_plenoctree::{
    BeforePalette, BilateralFilter, EdgeSmoothing, Ink, InkBorders, InkColor, LabelStages, PaletteExtraction,
    PaletteMethod, PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin, Posterize, PosterizeView, Prop,
    PropLighting, PropPath, PropPlacement, PropProgress, PropQuality, PropState, PropTint, RampAdjustment, Recolor,
    SolidOpacity, UploadBudget,
};
use serde::de::DeserializeSeed;
use serde_json::Value;

/// A text format of worlds.
#[derive(Clone, Copy, Debug)]
enum Format {
    Ron,
    Json,
}

impl Format {
    fn write(self, saved: &DynamicWorld, registry: &TypeRegistry) -> String {
        match self {
            Self::Ron => saved.serialize(registry).unwrap(),
            Self::Json => serde_json::to_string(&DynamicWorldSerializer::new(saved, registry)).unwrap(),
        }
    }

    fn read(self, text: &str, registry: &TypeRegistry, server: &AssetServer) -> DynamicWorld {
        let mut load_from_path = server;
        let seed = WorldDeserializer { type_registry: registry, load_from_path: &mut load_from_path };
        match self {
            Self::Ron => seed.deserialize(&mut ron::Deserializer::from_str(text).unwrap()).unwrap(),
            Self::Json => seed.deserialize(&mut serde_json::Deserializer::from_str(text)).unwrap(),
        }
    }
}

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), ScenePlugin, PlenOctreePlugin));
    // Apps whose Bevy has the feature `reflect_auto_register` need not do this.
    app.init_asset::<Shader>().register_type::<Transform>().register_type::<Name>();
    app.register_type::<ChildOf>().register_type::<Children>().register_type::<ObservedBy>();
    app
}

fn server(world: &World) -> AssetServer {
    world.resource::<AssetServer>().clone()
}

/// Spawns a prop and a camera that have all components of the plugin between them, none with default settings except
/// for `PropLighting`.
fn spawn(world: &mut World) -> [Entity; 2] {
    let server = server(world);
    let mut colors = PaletteOverride::default().with(2, Color::oklab(0.5, 0.1, -0.1));
    colors.adjust_ramp("red", &RampAdjustment { brightness: 0.1, ..RampAdjustment::to_color([0.1, 0.2, 0.9]) });
    let posterize = Posterize {
        softness: 0.125,
        filter: BilateralFilter { radius: 3, ..default() },
        edges: EdgeSmoothing::Off,
        method: Some(PaletteMethod::Hull),
        ..default()
    };
    let ink = Ink { color: InkColor::Tone(0.25), borders: InkBorders::Pairs(vec![[0, 3]]), ..default() };
    let prop = (
        Prop(server.load("robot.plenoctree")),
        posterize,
        Recolor { before_palette: BeforePalette::AsTrained },
        ink,
        colors,
        PropLighting::default(),
        PropTint(Color::linear_rgb(2.0, 0.5, 0.25)),
        SolidOpacity::At(0.25),
        Transform::from_xyz(1.0, 2.0, 3.0),
    );
    let camera = (
        PosterizeView(server.load("drum.plenoctree")),
        PropQuality::FAST,
        PropPlacement::Display,
        LabelStages(vec![server.load("lines.wgsl")]),
    );
    [world.spawn((Name::new("a prop"), prop)).id(), world.spawn((Name::new("the camera"), camera)).id()]
}

/// Saves entities in the order of what they consist of, numbered by it, as the guide shows.
fn save(world: &World, entities: &[Entity]) -> DynamicWorld {
    let registry = world.resource::<AppTypeRegistry>().read();
    let saved = DynamicWorldBuilder::from_world(world, &registry)
        .deny_component::<VisibilityClass>()
        .deny_component::<GlobalTransform>()
        .deny_component::<InheritedVisibility>()
        .deny_component::<ViewVisibility>()
        .deny_component::<Aabb>()
        .deny_component::<ChildOf>()
        .deny_component::<Children>()
        .deny_component::<ObservedBy>();
    let saved =
        saved.allow_resource::<PaletteExtraction>().allow_resource::<Palettes>().allow_resource::<UploadBudget>();
    let mut saved = saved.extract_entities(entities.iter().copied()).extract_resources().build();
    saved.entities.sort_by_cached_key(|saved| text(saved, &registry).unwrap());
    for (number, saved) in (0..).zip(&mut saved.entities) {
        saved.entity = Entity::from_raw_u32(number).unwrap();
    }
    saved
}

fn text(saved: &DynamicEntity, registry: &TypeRegistry) -> Result<String, ron::Error> {
    ron::to_string(&EntitySerializer { entity: saved, registry })
}

/// All components of the plugin are in saved worlds, except what it finds out by itself. Loading such a world in
/// another app and saving it again gives the same bytes.
#[test]
fn saved_worlds_come_back_whole() {
    for format in [Format::Ron, Format::Json] {
        let mut first = app();
        let entities = spawn(first.world_mut());
        let registry = first.world().resource::<AppTypeRegistry>().clone();
        let registry = registry.read();
        let text = format.write(&save(first.world(), &entities), &registry);
        let saved = |name: &str| text.contains(&format!("\"bevy_plenoctree::{name}\""));
        let components = registry.iter().filter(|registration| registration.data::<ReflectComponent>().is_some());
        let paths = components.map(|registration| registration.type_info().type_path_table());
        for path in paths.filter(|path| path.crate_name() == Some("bevy_plenoctree")) {
            let name = path.ident().unwrap();
            // A path becomes a prop at once. Resources are components, too.
            assert!(name == "PropPath" || saved(name), "{format:?}: {name} is missing in {text}");
        }
        // These hold only for one run of an app.
        assert!(["PropState", "PropProgress", "Palettes"].iter().all(|name| !saved(name)), "{format:?}: {text}");
        assert!(text.contains("robot.plenoctree") && text.contains("lines.wgsl"), "{text}");
        // What is drawn and moved changes nothing that is saved.
        first.world_mut().entity_mut(entities[0]).insert((
            Aabb::default(),
            GlobalTransform::from_translation(Vec3::X),
            InheritedVisibility::VISIBLE,
        ));
        assert_eq!(format.write(&save(first.world(), &entities), &registry), text, "{format:?}");

        let mut second = app();
        let world = second.world_mut();
        let registry = world.resource::<AppTypeRegistry>().clone();
        let registry = registry.read();
        let loaded = format.read(&text, &registry, &server(world));
        let mut map = EntityHashMap::default();
        loaded.write_to_world_with(world, &mut map, &registry).unwrap();
        let now = [0, 1].map(|number| map[&Entity::from_raw_u32(number).unwrap()]);
        let now = if world.entity(now[0]).contains::<Prop>() { now } else { [now[1], now[0]] };
        let [prop, camera] = now.map(|entity| world.entity(entity));
        let [first_prop, first_camera] = entities.map(|entity| first.world().entity(entity));
        assert_eq!(prop.get::<Posterize>(), first_prop.get::<Posterize>());
        assert_eq!(prop.get::<PaletteOverride>(), first_prop.get::<PaletteOverride>());
        assert_eq!(prop.get::<PropLighting>(), Some(&PropLighting::default()));
        assert_eq!(camera.get::<PropQuality>(), first_camera.get::<PropQuality>());
        // What the prop needs to be drawn is there, without being saved.
        assert!(prop.contains::<PropState>() && prop.contains::<PropProgress>());
        let path = |prop: &Prop| prop.0.path().unwrap().to_string();
        assert_eq!(prop.get().map(path).as_deref(), Some("robot.plenoctree"));

        assert_eq!(format.write(&save(world, &now), &registry), text, "{format:?}");
    }
}

/// Props without names, in any order, of one parent, and with an observer, are saved again with the same bytes.
#[test]
fn worlds_of_unnamed_props_are_saved_again_with_the_same_bytes() {
    let mut first = app();
    let world = first.world_mut();
    let field = server(world).load::<PlenOctree>("robot.plenoctree");
    let parent = world.spawn(Transform::default()).id();
    let props = [0.5, 0.25, 1.0, 0.25].map(|softness| {
        let prop = (Prop(field.clone()), Posterize { softness, ..default() }, ChildOf(parent));
        world.spawn(prop).observe(|_: On<Add, Name>| {}).id()
    });
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let text = Format::Ron.write(&save(world, &props), &registry);

    let mut second = app();
    let world = second.world_mut();
    let mut map = EntityHashMap::default();
    Format::Ron.read(&text, &registry, &server(world)).write_to_world(world, &mut map).unwrap();
    let loaded: Vec<Entity> = world.query_filtered::<Entity, With<Prop>>().iter(world).collect();
    assert_eq!(Format::Ron.write(&save(world, &loaded), &registry), text);
    let backward: Vec<Entity> = loaded.into_iter().rev().collect();
    assert_eq!(Format::Ron.write(&save(world, &backward), &registry), text);
}

/// Scenes in code name the field by its path.
#[test]
fn scenes_in_code_hold_props() {
    let mut app = app();
    let scene = bsn! {
        Prop("robot.plenoctree")
        Posterize { softness: 0.125 }
        PropLighting { shadows: 0.5 }
        PropTint(Color::BLACK)
        Transform { translation: {Vec3::X} }
        SolidOpacity::At(0.25)
        template_value(PaletteOverride::default().with_ramp("red", Color::WHITE))
    };
    let prop = app.world_mut().spawn_scene(scene).unwrap();
    assert_eq!(prop.get::<Prop>().unwrap().0.path().unwrap().to_string(), "robot.plenoctree");
    assert_eq!(prop.get(), Some(&Posterize { softness: 0.125, ..default() }));
    assert_eq!(prop.get(), Some(&PropLighting { shadows: 0.5, ..default() }));
    assert_eq!(prop.get(), Some(&PropTint(Color::BLACK)));
    assert_eq!(prop.get(), Some(&SolidOpacity::At(0.25)));
    assert_eq!(prop.get(), Some(&PaletteOverride::default().with_ramp("red", Color::WHITE)));

    let camera = bsn! {
        PosterizeView("drum.plenoctree")
        PropQuality { cell_size: 2.0 }
        PropPlacement::Display
        Ink { borders: InkBorders::Labels, color: InkColor::Tone(0.25) }
        LabelStages({VecTemplate(vec!["lines.wgsl".into()])})
    };
    let camera = app.world_mut().spawn_scene(camera).unwrap();
    assert_eq!(camera.get::<PosterizeView>().unwrap().0.path().unwrap().to_string(), "drum.plenoctree");
    assert_eq!(camera.get(), Some(&PropQuality { cell_size: 2.0, ..default() }));
    assert_eq!(camera.get(), Some(&PropPlacement::Display));
    assert_eq!(camera.get(), Some(&Ink { borders: InkBorders::Labels, color: InkColor::Tone(0.25), ..default() }));
    assert_eq!(camera.get::<LabelStages>().unwrap().0[0].path().unwrap().to_string(), "lines.wgsl");
}

/// Does with the extras of glTF nodes what Skein (a list of components) and Blenvy (components in RON by type path) do.
fn insert_extras(
    added: On<Add, GltfExtras>,
    extras: Query<&GltfExtras>,
    registry: Res<AppTypeRegistry>,
    mut commands: Commands,
) {
    let registry = registry.read();
    let mut commands = commands.entity(added.entity);
    let extras: Value = serde_json::from_str(&extras.get(added.entity).unwrap().value).unwrap();
    for component in extras["skein"].as_array().into_iter().flatten() {
        commands.insert_reflect(ReflectDeserializer::new(&registry).deserialize(component).unwrap());
    }
    if let Some(components) = extras["bevy_components"].as_str() {
        let components: serde_json::Map<String, Value> = serde_json::from_str(components).unwrap();
        for (path, component) in components {
            let text = format!("{{\"{path}\":{}}}", component.as_str().unwrap());
            let mut text = ron::Deserializer::from_str(&text).unwrap();
            commands.insert_reflect(ReflectDeserializer::new(&registry).deserialize(&mut text).unwrap());
        }
    }
}

/// What the asset server does not load becomes no prop, which would load forever.
#[test]
fn refused_paths_change_nothing() {
    let mut app = app();
    for path in ["", "../robot.plenoctree", "/robot.plenoctree", "robot.plenoctree#"] {
        let named = PropPath(path.into());
        let entity = app.world_mut().spawn(named.clone()).id();
        app.update();
        let entity = app.world().entity(entity);
        assert_eq!((entity.get(), entity.contains::<Prop>()), (Some(&named), false), "{path:?}");
    }
}

/// A prop that was placed in Blender: its components are written as text, without what has its default.
#[test]
fn nodes_of_gltf_files_hold_props() {
    let skein = r#"{"skein": [
        {"bevy_plenoctree::PropPath": "robot.plenoctree"},
        {"bevy_plenoctree::Posterize": {"softness": 0.125, "edges": "Off"}},
        {"bevy_plenoctree::PropLighting": {"shadows": 0.5}},
        {"bevy_plenoctree::SolidOpacity": {"At": 0.25}},
        {"bevy_plenoctree::PaletteOverride": {"ramps": [["red", {"brightness": 0.1}]]}}
    ]}"#;
    let blenvy = serde_json::json!({"bevy_components": serde_json::json!({
        "bevy_plenoctree::PropPath": "(\"robot.plenoctree\")",
        "bevy_plenoctree::Posterize": "(softness: 0.125, edges: Off)",
        "bevy_plenoctree::PropLighting": "(shadows: 0.5)",
        "bevy_plenoctree::SolidOpacity": "At(0.25)",
        "bevy_plenoctree::PaletteOverride": "(ramps: [(\"red\", (brightness: 0.1))])",
    }).to_string()});
    for extras in [skein.to_string(), blenvy.to_string()] {
        let mut app = app();
        let node =
            app.add_observer(insert_extras).world_mut().spawn((GltfExtras { value: extras }, Transform::IDENTITY));
        let node = node.id();
        app.world_mut().flush();
        let prop = app.world().entity(node);
        assert_eq!(prop.get::<Prop>().unwrap().0.path().unwrap().to_string(), "robot.plenoctree");
        assert!(!prop.contains::<PropPath>());
        assert_eq!(prop.get(), Some(&Posterize { softness: 0.125, edges: EdgeSmoothing::Off, ..default() }));
        assert_eq!(prop.get(), Some(&PropLighting { shadows: 0.5, ..default() }));
        assert_eq!(prop.get(), Some(&SolidOpacity::At(0.25)));
        let mut colors = PaletteOverride::default();
        colors.adjust_ramp("red", &RampAdjustment { brightness: 0.1, ..default() });
        assert_eq!(prop.get(), Some(&colors));
    }
}
