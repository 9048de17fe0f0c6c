//! The field on the GPU.

mod faintness;
mod field;
mod levels;
mod payload;
mod records;
mod shaders;
mod upload;

pub(crate) use field::{FieldLayout, FieldShape, GpuLevel, Uploader};
pub use field::{FieldTooLarge, GpuField};
pub(crate) use levels::Level;
pub(crate) use shaders::{Shaders, field_definitions};

use bevy::{
    prelude::*,
    render::{Render, RenderApp, RenderSystems, render_asset::RenderAssetPlugin},
};

/// Uploads every loaded [`PlenOctree`](crate::field::PlenOctree).
pub(crate) struct GpuFieldPlugin;

impl Plugin for GpuFieldPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        let shaders = Shaders::add_to(app);
        app.add_plugins(RenderAssetPlugin::<GpuField>::default());
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app
                .insert_resource(shaders)
                .init_resource::<FieldLayout>()
                .add_systems(Render, field::drop_idle_levels.in_set(RenderSystems::Cleanup));
        }
    }
}
