//! The file that holds the props.

use std::{fmt::Display, fs, path::PathBuf};

use bevy::{
    ecs::entity::EntityHashMap,
    prelude::*,
    world_serialization::serde::{EntitySerializer, WorldDeserializer},
};
use bevy_plenoctree::{Ink, prelude::*};
use serde::de::DeserializeSeed;

use crate::{
    show::Result,
    toys::{self, Toy},
};

/// The file to save to and to load from.
#[derive(Resource)]
pub struct WorldFile(pub PathBuf);

pub fn plugin(app: &mut App) {
    // Bevy registers its own types if it has the feature `reflect_auto_register`, which is one of its defaults. The
    // examples do without most defaults.
    app.register_type::<Transform>().register_type::<Name>().add_systems(Update, save_or_load.pipe(log));
}

/// Spawns the toys of the file or, if there is none or it cannot be loaded, those of before anything is saved.
pub fn start(world: &mut World) -> Result {
    toys::spawn(world);
    if world.resource::<WorldFile>().0.exists() { load(world) } else { Ok(()) }
}

/// Logs an error. Bevy would panic.
pub fn log(In(result): In<Result>) {
    if let Err(error) = result {
        error!("{error}");
    }
}

fn save_or_load(world: &mut World) -> Result {
    let is_pressed = |key| world.get_resource::<ButtonInput<KeyCode>>().is_some_and(|keys| keys.just_pressed(key));
    match (is_pressed(KeyCode::KeyS), is_pressed(KeyCode::KeyL)) {
        (true, _) => save(world),
        (false, true) => load(world),
        (false, false) => Ok(()),
    }
}

/// Writes all toys, with the components that make them what they are.
fn save(world: &mut World) -> Result {
    let toys: Vec<Entity> = world.query_filtered::<Entity, With<Toy>>().iter(world).collect();
    let registry = world.resource::<AppTypeRegistry>().read();
    let mut saved = DynamicWorldBuilder::from_world(world, &registry)
        .allow_component::<Toy>()
        .allow_component::<Name>()
        .allow_component::<Transform>()
        .allow_component::<Prop>()
        .allow_component::<Posterize>()
        .allow_component::<PaletteOverride>()
        .allow_component::<Ink>()
        .extract_entities(toys.into_iter())
        .build();
    // Bevy numbers entities anew when it loads them. In the order of what they consist of, and with these numbers, a world
    // that is saved again has the same bytes.
    saved.entities.sort_by_cached_key(|saved| {
        ron::to_string(&EntitySerializer { entity: saved, registry: &registry }).unwrap_or_default()
    });
    for (number, saved) in (0..).zip(&mut saved.entities) {
        saved.entity = Entity::from_raw_u32(number).ok_or("too many toys")?;
    }
    let file = &world.resource::<WorldFile>().0;
    fs::write(file, saved.serialize(&registry)?).map_err(|error| format!("{}: {error}", file.display()))?;
    info!("saved {} props to {}", saved.entities.len(), file.display());
    Ok(())
}

/// Replaces all toys by those in the file.
fn load(world: &mut World) -> Result {
    let file = world.resource::<WorldFile>().0.clone();
    let named = |error: &dyn Display| format!("{}: {error}", file.display());
    let text = fs::read_to_string(&file).map_err(|error| named(&error))?;
    let registry = world.resource::<AppTypeRegistry>().clone();
    let mut server = world.resource::<AssetServer>().clone();
    let seed = WorldDeserializer { type_registry: &registry.read(), load_from_path: &mut server };
    let mut reader = ron::Deserializer::from_str(&text).map_err(|error| named(&error))?;
    let loaded = seed.deserialize(&mut reader).map_err(|error| named(&reader.span_error(error)))?;

    let toys: Vec<Entity> = world.query_filtered::<Entity, With<Toy>>().iter(world).collect();
    for toy in toys {
        world.despawn(toy);
    }
    loaded.write_to_world(world, &mut EntityHashMap::default())?;
    Ok(())
}
