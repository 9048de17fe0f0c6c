//! What a view needs before its frame is planned: the level of each prop, and the pipelines of what it may soon draw.

use bevy::{
    camera::MainPassResolutionOverride,
    platform::collections::HashSet,
    prelude::*,
    render::{camera::ExtractedCamera, render_asset::RenderAssets, view::ExtractedView},
};

use super::{
    decide::Known,
    view::{Kind, Plan, drawn_viewport},
};
use crate::{
    gpu::{FieldShape, GpuField, Level, MAX_PROPS_IN_VIEW},
    render::extract::{ExtractedProps, OrderedProp, VisibleProps},
};

/// Sorts the props of every view back to front, and requests their levels.
pub(in crate::render) fn choose_levels(
    extracted: Res<ExtractedProps>,
    mut fields: ResMut<RenderAssets<GpuField>>,
    mut views: Query<(&ExtractedView, &ExtractedCamera, Option<&MainPassResolutionOverride>, &mut VisibleProps)>,
) {
    for (view, camera, resolution, mut visible) in &mut views {
        let VisibleProps { props, order, quality, .. } = &mut *visible;
        order.clear();
        let Some(viewport) = drawn_viewport(camera, resolution) else {
            continue;
        };
        let (eye, forward) = (view.world_from_view.translation(), view.world_from_view.forward());
        order.extend(props.iter().filter_map(|&index| {
            let index = extracted.drawn(index, &fields)?;
            let prop = extracted.props.get(index)?;
            let field = fields.get_mut(prop.field)?;
            let rays = prop.pose.rays(&view.world_from_view, view.clip_from_view, viewport.physical_size)?;
            let level = prop.pose.level(rays.cell_size, quality);
            field.request(level);
            let distance = (prop.pose.center() - eye.as_dvec3()).dot(forward.as_dvec3());
            Some(OrderedProp { distance, index, level })
        }));
        // Break ties by index, so that the order is deterministic. A stable sort would allocate.
        order.sort_unstable_by(|a, b| b.distance.total_cmp(&a.distance).then(a.index.cmp(&b.index)));
        if order.len() > MAX_PROPS_IN_VIEW {
            error_once!("a camera sees {} props but draws only the nearest {MAX_PROPS_IN_VIEW}", order.len());
            order.drain(..order.len() - MAX_PROPS_IN_VIEW);
        }
    }
}

/// Returns the kinds of props that may be drawn soon, and the plan in which they would be: those of fields that are
/// arriving or that no prop shows yet.
pub(in crate::render) fn look_ahead(known: &Known) -> (Plan, Vec<Kind>) {
    let Known { extracted, fields, visible, .. } = known;
    let props = || visible.props.iter().filter_map(|index| extracted.props.get(*index));
    let plan = Plan {
        samples: known.samples,
        // Programs of props that overlap no other bind nothing of this.
        overlaps: true,
        posterizes: visible.view_posterize.is_some() || props().any(|prop| prop.posterize.is_some()),
        is_lit: props().any(|prop| known.is_lit(prop)),
        has_fog: known.has_fog(),
        has_motion: known.has_motion(),
        ..default()
    };
    let shown: HashSet<_> = extracted.props.iter().map(|prop| prop.field).collect();
    let shapes = fields.iter().filter_map(|(id, field)| {
        let unseen = || field.level(Level::default()).filter(|_| !shown.contains(&id));
        field.arriving_shape().or_else(|| Some(unseen()?.shape))
    });
    let looks: HashSet<_> = props().map(|prop| (known.is_lit(prop), prop.recolor.is_some())).collect();
    let overlaps = if visible.props.len() > 1 { &[false, true][..] } else { &[false] };
    let mut kinds = vec![];
    for shape in shapes.collect::<HashSet<FieldShape>>() {
        for (is_lit, may_recolor) in looks.iter().copied() {
            kinds.extend(overlaps.iter().map(|&overlaps| Kind { shape, overlaps, is_lit, may_recolor }));
        }
    }
    (plan, kinds)
}
