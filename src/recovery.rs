//! Recovery from a lost GPU device.

use bevy::{
    prelude::*,
    render::{
        RenderPlugin,
        error_handler::{ErrorType, RenderError, RenderErrorHandler, RenderErrorPolicy},
        settings::{RenderCreation, WgpuSettings},
    },
};

/// A plugin that replaces the GPU device when it is lost, for example because the driver was updated or crashed.
/// Without it, Bevy quits the app.
///
/// Add it after Bevy's `DefaultPlugins`. It sets Bevy's [`RenderErrorHandler`]. The new device gets the settings of the
/// app's [`RenderPlugin`]; if that plugin was given a device, the new one gets the default settings. Fields are
/// uploaded again, and props are drawn as before after some frames. Other errors are left to the handler that the app had
/// before, which quits the app by default.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{DeviceRecoveryPlugin, PlenOctreePlugin};
/// App::new().add_plugins((DefaultPlugins, PlenOctreePlugin, DeviceRecoveryPlugin)).run();
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct DeviceRecoveryPlugin;

impl Plugin for DeviceRecoveryPlugin {
    fn build(&self, app: &mut App) {
        let settings =
            app.get_added_plugins::<RenderPlugin>().first().and_then(|plugin| match &plugin.render_creation {
                RenderCreation::Automatic(settings) => Some(WgpuSettings::clone(settings)),
                RenderCreation::Manual(_) => None,
            });
        let others = app.world_mut().remove_resource().unwrap_or_default();
        app.insert_resource(DeviceRecovery { settings: settings.unwrap_or_default(), others })
            .insert_resource(RenderErrorHandler(recover));
    }
}

#[derive(Resource)]
struct DeviceRecovery {
    /// The settings of the device.
    settings: WgpuSettings,
    /// What handles other errors.
    others: RenderErrorHandler,
}

fn recover(error: &RenderError, main_world: &mut World, render_world: &mut World) -> RenderErrorPolicy {
    let recovery = main_world.get_resource::<DeviceRecovery>();
    match (&error.ty, recovery) {
        (ErrorType::DeviceLost, Some(recovery)) => {
            warn!("the GPU device was lost and will be replaced: {}", error.description);
            RenderErrorPolicy::Recover(recovery.settings.clone().into())
        }
        _ => {
            let others = recovery.map_or(RenderErrorHandler::default().0, |recovery| recovery.others.0);
            others(error, main_world, render_world)
        }
    }
}
