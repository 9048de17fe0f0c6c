//! The passes of a view: which there are, and in which order they run. See each file for what its passes do.

mod edges;
mod labels;
#[cfg(feature = "shadows")]
mod lighting;
mod objects;
#[cfg(all(test, feature = "headless"))]
mod tests;
mod volume;

#[cfg(feature = "shadows")]
pub(super) use lighting::{lights_layout, lit_props};
pub(super) use objects::draw_objects;
pub(super) use volume::request;

use bevy::{app::SubApp, render::render_resource::PipelineCache};

use super::{
    frame::{Pass, Pipelines, RaySet},
    plan::{Kind, Plan, PlannedProp},
    uniforms::Smooths,
};

/// The names of the spans in Bevy's render diagnostics whose times add up to the time of drawing props.
pub const VOLUME_SPANS: &[&str] =
    &[volume::VOLUME, volume::VOLUME_BATCHES, volume::SOLID, volume::SOLID_BATCHES, volume::CHECK, volume::FILL];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of all that follows
/// [`VOLUME_SPANS`]: posterizing, fog, transparent objects over props, and writing the target. Props as trained need
/// some of it, too. Custom stages and the light on props are not included.
pub const POSTERIZE_SPANS: &[&str] = &[
    labels::PRESENT,
    labels::LABEL,
    labels::COMPOSITE,
    labels::FILTER,
    labels::FINISH,
    edges::OUTLINE,
    edges::COVERAGE,
    objects::HIDE_OBJECTS,
    objects::RESTORE_DEPTH,
    objects::UNDER_OBJECTS,
    objects::OBJECTS,
    #[cfg(feature = "shadows")]
    lighting::FOG,
];
/// The names of the spans in Bevy's render diagnostics whose times add up to the time of lighting props.
#[cfg(feature = "shadows")]
pub const LIGHTING_SPANS: &[&str] = &[lighting::LIGHTING, lighting::SMOOTH_LIGHT];

/// Returns the passes of a frame, in the order in which they run.
pub(super) fn of(plan: &Plan) -> Vec<Pass> {
    let mut passes = vec![];
    for rays in if plan.is_sparse { &[RaySet::Grid, RaySet::Batches][..] } else { &[RaySet::Pixels] } {
        passes.extend(volume::solid(plan, *rays));
        passes.push(volume::volume(plan, *rays));
        match rays {
            RaySet::Grid => passes.push(volume::check(plan)),
            RaySet::Batches => passes.push(volume::fill(plan)),
            RaySet::Pixels => {}
        }
    }
    passes.extend(edges::outline(plan));
    passes.extend(labels::composite(plan));
    passes.extend(edges::coverage(plan));
    #[cfg(feature = "shadows")]
    passes.extend(lighting::lighting(plan).into_iter().chain(lighting::smooth_light(plan)));
    passes.extend(objects::hide_objects(plan));
    passes.extend(labels::filter(plan));
    passes.push(labels::label(plan));
    passes.extend(labels::finish(plan));
    passes.extend(labels::stages(plan));
    #[cfg(feature = "shadows")]
    passes.extend(lighting::fog(plan));
    passes.extend(labels::present(plan));
    passes.extend(objects::under_objects(plan));
    passes.extend(objects::objects(plan));
    passes.sort_by_key(|pass| pass.place);
    passes
}

/// Requests the pipelines of everything that is drawn for props of these kinds in place of those of a plan.
pub(super) fn request_alike(plan: &mut Plan, kinds: &[Kind], pipelines: &mut Pipelines, cache: &PipelineCache) {
    let Some(drawn) = plan.props.first() else {
        return;
    };
    let smooths = if plan.smooths { Smooths::Slits } else { Smooths::Nothing };
    let can_be_drawn = |kind: &&Kind| kind.overlaps <= plan.overlaps && kind.is_lit <= plan.is_lit;
    let alike = |kind: &Kind| PlannedProp { kind: *kind, smooths, may_be_solid: true, ..drawn.clone() };
    let alike = kinds.iter().filter(can_be_drawn).map(alike).collect();
    let planned = std::mem::replace(&mut plan.props, alike);
    for pass in of(plan) {
        for program in &pass.programs {
            pipelines.get(cache, &pass, program, plan.target.format);
        }
    }
    plan.props = planned;
}

/// Adds the systems of passes that need more than a row.
pub(super) fn plugin(render_app: &mut SubApp) {
    objects::plugin(render_app);
    #[cfg(feature = "shadows")]
    lighting::plugin(render_app);
}
