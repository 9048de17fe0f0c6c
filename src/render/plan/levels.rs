//! Chooses the level at which each prop of a view is drawn.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{camera::ExtractedCamera, render_asset::RenderAssets, view::ExtractedView},
};

use super::view::drawn_viewport;
use crate::{
    gpu::{GpuField, MAX_PROPS_IN_VIEW},
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
