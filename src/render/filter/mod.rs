//! The bilateral filter, which flattens colors before labels are assigned. See section 4 of the method, step 2.

mod pass;
mod pipeline;

pub use pass::FILTER_SPAN;

use bevy::prelude::*;

use super::{
    pass::{Pass, add_pass},
    steps::PosterizeSteps,
};

pub(super) fn plugin(app: &mut App) {
    let systems = Pass {
        init: pipeline::init.into_configs(),
        prepare_pipelines: pass::require_pipelines.into_configs(),
        prepare_bind_groups: pass::prepare_bind_groups.into_configs(),
        draw: pass::filter_pass,
    };
    add_pass::<pass::FilterBindGroups, _, _, _>(app, PosterizeSteps::Filter, systems);
}
