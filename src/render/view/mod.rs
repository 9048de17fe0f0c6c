//! The resources that a view's passes share: its props and their palettes, its textures, and bind group 0.

mod bind_groups;
mod layout;
mod levels;
mod memory;
mod motion;
mod overlap;
mod prepare;
mod props;
mod textures;
mod uniforms;

pub(super) use bind_groups::ViewBindGroups;
pub(super) use layout::ViewLayouts;
#[cfg(feature = "shadows")]
pub(super) use levels::levels_coarser;
pub(crate) use memory::ViewMemory;
pub(super) use memory::view_texture;
#[cfg(feature = "shadows")]
pub(super) use prepare::{covered, extent};
pub(super) use props::{DrawnProp, Overlap, ViewProps};
pub(super) use textures::{
    DEPTH_FORMAT, GAP_FORMAT, LAYER_FORMAT, MOTION_FORMAT, OWNER_FORMAT, ViewTextures, drawn_viewport, grid_size,
    spacing,
};
pub(super) use uniforms::{PropUniform, ViewUniform};

use bevy::{
    core_pipeline::core_3d::prepare_core_3d_depth_textures,
    prelude::*,
    render::{Render, RenderApp, RenderStartup, RenderSystems, render_resource::TextureUsages},
};

use super::{composite::CompositeTextures, extract::VisibleProps, steps::PrepareTextures};
use crate::{gpu::InitFields, sets::PlenOctreeRenderSystems};

/// Prepares views for the passes.
pub(super) fn plugin(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, ViewProps>();
    render_app.world_mut().register_required_components::<VisibleProps, ViewMemory>();
    render_app.world_mut().register_required_components::<VisibleProps, ViewBindGroups>();
    render_app
        .add_systems(RenderStartup, (forget_views, layout::init).chain().in_set(InitViews).after(InitFields))
        .add_systems(
            Render,
            (
                read_depth
                    .after(memory::skip_views)
                    .before(prepare_core_3d_depth_textures)
                    .in_set(RenderSystems::PrepareResources),
                (memory::skip_views, levels::choose_levels).chain().in_set(PlenOctreeRenderSystems::ChooseLevels),
                (textures::prepare_textures, prepare::prepare_views)
                    .chain()
                    .in_set(PlenOctreeRenderSystems::PrepareViews),
                memory::report_shortages
                    .after(PrepareTextures)
                    .before(PlenOctreeRenderSystems::PreparePipelines)
                    .in_set(RenderSystems::PrepareResources),
                bind_groups::prepare.in_set(PlenOctreeRenderSystems::PrepareBindGroups).in_set(BindViews),
            ),
        );
}

/// The systems in `RenderStartup` that run before the passes create their pipelines.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct InitViews;

/// Creates bind group 0.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct BindViews;

/// Removes the components of views that belong to a lost device. The next extraction adds them again.
fn forget_views(mut commands: Commands, views: Query<Entity, With<VisibleProps>>) {
    for view in &views {
        commands.entity(view).remove_with_requires::<VisibleProps>().remove::<(ViewTextures, CompositeTextures)>();
    }
}

/// Lets the volume pass read the depth textures of cameras that draw something.
fn read_depth(mut cameras: Query<(&mut Camera3d, &VisibleProps)>) {
    for (mut camera, visible) in &mut cameras {
        if !visible.is_empty() {
            camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
        }
    }
}
