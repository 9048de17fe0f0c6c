//! What a view may soon draw, so that the pipelines are ready when it does.

use bevy::{platform::collections::HashSet, prelude::*, render::render_asset::RenderAssets};

use super::{
    decide::Known,
    view::{Kind, Plan, Target},
};
use crate::{
    camera::PropPlacement,
    gpu::{FieldShape, GpuField, Level},
    render::extract::{ExtractedProp, ExtractedProps},
};

/// Returns the kinds of props that may be drawn soon, and the plan in which they would be: those of fields that are
/// arriving or that no prop shows yet.
pub(in crate::render) fn look_ahead(
    known: &Known,
    extracted: &ExtractedProps,
    fields: &RenderAssets<GpuField>,
) -> (Plan, Vec<Kind>) {
    let visible = known.visible;
    let props = || visible.props.iter().filter_map(|index| extracted.props.get(*index));
    let in_scene = known.placement == PropPlacement::Scene;
    let is_lit = |prop: &ExtractedProp| in_scene && visible.has_lights && prop.is_lit();
    let plan = Plan {
        samples: known.samples,
        target: Target { format: known.view.target_format, ..default() },
        // Programs of props that overlap no other bind nothing of this.
        overlaps: true,
        posterizes: visible.view_posterize.is_some() || props().any(|prop| prop.posterize.is_some()),
        is_lit: props().any(is_lit),
        has_fog: in_scene && visible.has_fog,
        has_motion: in_scene && visible.has_motion,
        ..default()
    };
    let shown: HashSet<_> = extracted.props.iter().map(|prop| prop.field).collect();
    let shapes = fields.iter().filter_map(|(id, field)| {
        let unseen = || field.level(Level::default()).filter(|_| !shown.contains(&id));
        field.arriving_shape().or_else(|| Some(unseen()?.shape))
    });
    let looks: HashSet<_> = props().map(|prop| (is_lit(prop), prop.recolor.is_some())).collect();
    let overlaps = if visible.props.len() > 1 { &[false, true][..] } else { &[false] };
    let mut kinds = vec![];
    for shape in shapes.collect::<HashSet<FieldShape>>() {
        for (is_lit, may_recolor) in looks.iter().copied() {
            kinds.extend(overlaps.iter().map(|&overlaps| Kind { shape, overlaps, is_lit, may_recolor }));
        }
    }
    (plan, kinds)
}
