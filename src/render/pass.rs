//! Adds passes to the render app.

use bevy::{
    core_pipeline::schedule::Core3d,
    ecs::{schedule::ScheduleConfigs, system::ScheduleSystem},
    prelude::*,
    render::{Render, RenderApp, RenderStartup},
};

use super::{extract::VisibleProps, view::InitViews};
use crate::{sets::PlenOctreeRenderSystems, stage::PropStage};

/// The systems of a pass that runs at either place in the frame.
pub(super) struct Pass<D> {
    /// Creates the pipelines, or the resources that they are specialized from.
    pub init: ScheduleConfigs<ScheduleSystem>,
    pub prepare_pipelines: ScheduleConfigs<ScheduleSystem>,
    pub prepare_bind_groups: ScheduleConfigs<ScheduleSystem>,
    /// Draws, if the view's props are drawn at the given place.
    pub draw: D,
}

/// Adds a pass, whose state is a component of every view. `set` returns the pass's set at one place in the frame.
pub(super) fn add_pass<State, Set, D, M>(app: &mut App, set: impl Fn(PropStage) -> Set, pass: Pass<D>)
where
    State: Component + Default,
    Set: SystemSet,
    D: IntoSystem<InMut<'static, PropStage>, (), M> + Copy,
{
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else {
        return;
    };
    render_app.world_mut().register_required_components::<VisibleProps, State>();
    render_app.add_systems(RenderStartup, pass.init.after(InitViews)).add_systems(
        Render,
        (
            pass.prepare_pipelines.in_set(PlenOctreeRenderSystems::PreparePipelines),
            pass.prepare_bind_groups.in_set(PlenOctreeRenderSystems::PrepareBindGroups),
        ),
    );
    for stage in [PropStage::Scene, PropStage::Display] {
        render_app.add_systems(Core3d, pass.draw.with_input(stage).in_set(set(stage)));
    }
}
