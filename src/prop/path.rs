//! Props of fields that are named by their paths.

use bevy::{
    asset::AssetPath,
    ecs::{lifecycle::HookContext, world::DeferredWorld},
    prelude::*,
};

use super::component::Prop;

/// Becomes a [`Prop`] of the field at an asset path, such as `"robot.plenoctree"`.
///
/// Use it where components are written as text and handles cannot be: in the extras of glTF nodes, for example, into
/// which Skein and Blenvy write the components that are added in Blender. When it is inserted, the field starts to
/// load, and a [`Prop`] replaces this component.
///
/// A path that cannot be parsed, or that the asset server refuses because it is empty or leads out of the asset folder,
/// is logged as an error, and changes nothing. In a world without an [`AssetServer`], such
/// as that of a glTF scene, the component waits until it is copied to one that has it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, Prop, PropPath};
/// # let mut app = App::new();
/// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
/// let robot = app.world_mut().spawn(PropPath("robot.plenoctree".into())).id();
/// assert!(app.world().entity(robot).contains::<Prop>());
/// assert!(!app.world().entity(robot).contains::<PropPath>());
/// ```
#[derive(Component, Clone, Debug, Default, PartialEq, Eq, Hash, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
#[component(on_insert = load)]
pub struct PropPath(pub String);

/// Replaces a path with the prop that it names.
fn load(mut world: DeferredWorld, HookContext { entity, .. }: HookContext) {
    let (Some(PropPath(path)), Some(server)) = (world.get(entity), world.get_resource::<AssetServer>()) else {
        return;
    };
    match AssetPath::try_parse(path) {
        Ok(path) => {
            let field = server.load(path.into_owned());
            // Bevy has logged why.
            if field == Handle::default() {
                return;
            }
            world.commands().entity(entity).try_insert(Prop(field)).try_remove::<PropPath>();
        }
        Err(error) => error!("failed to parse the path {path:?} of a prop: {error}"),
    }
}
